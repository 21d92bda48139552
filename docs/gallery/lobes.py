"""The map close to the interruption of chatter: infinitely many lobes, each a smaller
copy of the previous one, scaled by two powers of the coefficient of restitution."""

from jaxcam.plotting import beta_lobes


figure = beta_lobes(r=0.6, lobes=4)
