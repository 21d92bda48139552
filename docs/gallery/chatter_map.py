"""Near the release point, chatter is a one-dimensional map from impact to impact: to
the left of its unstable fixed point, chatter is complete; to the right, it is
interrupted after finitely many impacts."""

from jaxcam.plotting import lambda_cobweb


figure = lambda_cobweb(r=0.6)
