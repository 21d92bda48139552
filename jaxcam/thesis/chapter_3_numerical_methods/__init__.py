"""Chapter 3: numerical methods and continuation of branches."""
