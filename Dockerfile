# docker build -t hybrid_slam . && docker run --rm -v $PWD/data:/data hybrid_slam /data/kitti --out /data/out
# Builds the Debian packages in one Debian 12, installs them in another. Cameras of the machine: --device /dev/video0.
FROM debian:12-slim AS build
COPY . /src
WORKDIR /src
RUN ./run package

FROM debian:12-slim
COPY --from=build /src/build/release/packages/hybrid-slam_*.deb /src/build/release/packages/hybrid-slam-live_*.deb \
     /src/build/release/packages/python3-*.deb /tmp/
# hadolint ignore=DL3008  # the versions are those of Debian 12
RUN apt-get update \
 && apt-get install -y --no-install-recommends libopenblas0-serial /tmp/*.deb \
 && rm -rf /tmp/*.deb /var/lib/apt/lists/*
WORKDIR /data
ENTRYPOINT ["hybrid_slam"]
CMD ["--help"]
