"""Chapter 3: numerical methods, and the branches they follow."""
