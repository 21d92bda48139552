"""Chapter 4: the cam-follower, its rig and the experiment."""
