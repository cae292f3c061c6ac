"""The package that Blender loads: the extension's folder."""

from .addon import register, unregister
