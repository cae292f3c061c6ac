"""The live preview, and drawing over viewports."""
