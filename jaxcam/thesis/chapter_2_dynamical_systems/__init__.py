"""Chapter 2: dynamical systems, smooth and not."""
