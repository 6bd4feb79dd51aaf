"""Go-ICP: globally optimal registration by branch and bound (Yang, Li, Campbell and Jia 2016)."""
