# Your own arducopter binary as an image, for compose.ardupilot.yaml. The context is the folder that holds it:
#
#   docker build -f docker/ardupilot.Dockerfile -t my-arducopter:4.6 .../ardupilot/build/sitl/bin
#
# The binary's C library must not be newer than this image's (glibc 2.41): a build on Ubuntu 24.04 or Debian 13 fits.
FROM debian:trixie-slim
COPY arducopter /usr/local/bin/arducopter
USER 10001:10001
WORKDIR /tmp
ENTRYPOINT ["arducopter"]
