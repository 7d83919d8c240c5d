"""``python -m hsop_gcs`` is ``hsop-gcs``."""

from hsop_gcs.cli import main

if __name__ == "__main__":
    main()
