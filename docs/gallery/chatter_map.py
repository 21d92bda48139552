"""From impact to impact near the release point chatter is a map of one number; left of
its unstable fixed point the chatter completes, right of it a last impact is lost."""

from jaxcam.plotting import lambda_cobweb


figure = lambda_cobweb(r=0.6)
