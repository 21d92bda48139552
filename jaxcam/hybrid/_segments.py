"""placeholder"""
def simulate_segments(*a): raise NotImplementedError
