"""Structure from motion: feature tracks, cameras, points, and the working folder that keeps them."""

from ..base.system import check_libraries

# Before the worker loads more of them.
check_libraries()
