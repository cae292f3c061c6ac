"""CG objects, drawn by Cycles in a process of their own."""
