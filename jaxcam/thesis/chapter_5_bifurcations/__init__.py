"""Chapter 5: bifurcation diagrams, motions, basins and the local map."""
