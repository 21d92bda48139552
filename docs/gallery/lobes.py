"""The map close to the interruption of chatter: infinitely many lobes, each a smaller
copy of the previous one, with two scale factors set by the coefficient of
restitution."""

from jaxcam.plotting import beta_lobes


figure = beta_lobes(r=0.6, lobes=4)
