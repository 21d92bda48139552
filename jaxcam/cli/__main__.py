"""Run the command line as `python -m jaxcam.cli`."""

from ._app import main


if __name__ == "__main__":
    main()
