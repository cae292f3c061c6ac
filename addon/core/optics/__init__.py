"""The thin lens and its aperture: circles of confusion, shapes, samples, registration of views."""
