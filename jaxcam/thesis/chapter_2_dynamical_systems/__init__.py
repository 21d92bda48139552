"""Chapter 2: smooth and nonsmooth dynamical systems."""
