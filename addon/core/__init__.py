"""Pure computation: numpy and OpenCV in, arrays and small frozen dataclasses out. Never imports bpy."""
