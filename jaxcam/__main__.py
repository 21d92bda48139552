"""Run the command line as `python -m jaxcam`."""

from .cli import main


if __name__ == "__main__":
    main()
