# As debian12.Dockerfile, for Ubuntu 20.04 with ROS Noetic:
#   docker build -t active_matching_slam -f docker/ubuntu20.04.Dockerfile .
FROM ros:noetic-ros-core-focal AS build
COPY . /source
RUN apt-get update && apt-get install -y --no-install-recommends dpkg-dev file \
 && /source/scripts/package --output /packages --folder /build

FROM ros:noetic-ros-core-focal
COPY --from=build /packages /packages
RUN apt-get update \
 && apt-get install -y --no-install-recommends /packages/ros-noetic-active-matching-slam_*.deb \
 && rm -rf /var/lib/apt/lists/*
ENV ROS_HOSTNAME=localhost
CMD ["roslaunch", "active_matching_slam", "demo.launch", "rviz:=false"]
