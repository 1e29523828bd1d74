# The packages for Debian 12 made and installed, and the demonstration run, without a screen:
#   docker build -t active_matching_slam -f docker/debian12.Dockerfile .
#   docker run --rm active_matching_slam
FROM debian:12 AS build
COPY . /source
RUN apt-get update && apt-get install -y --no-install-recommends dpkg-dev file \
 && /source/scripts/package --output /packages --folder /build

FROM debian:12
COPY --from=build /packages /packages
RUN apt-get update \
 && apt-get install -y --no-install-recommends /packages/active-matching-slam_*.deb \
 && rm -rf /var/lib/apt/lists/*
ENV ROS_HOSTNAME=localhost
CMD ["roslaunch", "active_matching_slam", "demo.launch", "rviz:=false"]
