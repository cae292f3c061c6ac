"""Work in other processes: movies, renders, exports, depth, the first focus."""
