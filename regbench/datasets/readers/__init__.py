"""File readers, one module a format. What is wrong with a file is a UserError of one line that names it."""
