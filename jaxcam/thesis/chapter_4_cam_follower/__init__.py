"""Chapter 4: the cam-follower model, the rig and the experiment."""
