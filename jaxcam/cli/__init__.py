"""The command line, `jaxcam`. Nothing else imports it."""

from ._app import app as app, main as main
