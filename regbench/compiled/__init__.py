"""How compiled functions are kept between processes, and what the first of them costs."""
