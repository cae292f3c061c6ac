"""The package that Blender loads: the extension's folder. Its names are the public Python interface."""

from .addon import register, unregister
from .addon.api import UserError, depth, export, pick, render, solve
