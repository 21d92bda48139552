"""The command line, `jaxcam`, and its reports. Nothing else imports it."""

from ._app import app as app, main as main
from ._write_report import write_report as write_report
