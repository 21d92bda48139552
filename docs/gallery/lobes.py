"""What an interrupted chatter leaves over: infinitely many lobes, each a smaller copy
of the one before, as wide and as deep as two powers of the restitution say."""

from jaxcam.plotting import beta_lobes


figure = beta_lobes(r=0.6, lobes=4)
