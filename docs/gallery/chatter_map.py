"""Near the release point, chatter is a one-dimensional map from impact to impact: left
of its unstable fixed point the chatter is complete, right of it the last impact is
lost."""

from jaxcam.plotting import lambda_cobweb


figure = lambda_cobweb(r=0.6)
