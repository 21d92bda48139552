"""Chapter 5: bifurcation diagrams, motions, basins, the local map."""
