"""Chapter 3: numerical methods and continued branches."""
