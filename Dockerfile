# The render service as an image: built from the sources, run by an unprivileged user, with bubblewrap inside.
#
#   docker build -t primray .
#   docker run -p 8700:8700 -v primray-data:/data primray
#
# Build arguments: PIP_CERT, a file mounted into the build with the certificates that pip is to trust (behind a proxy of your own);
# EXTRAS, what is installed of primray's extras (denoise: Open Image Denoise; s3: --data s3://...). The server and the nodes of a
# Ray cluster need `ray` too, all by the same image:
#
#   docker build -t primray:ray --build-arg EXTRAS=server,postgres,otel,denoise,s3,ray .

FROM docker.io/library/debian:12-slim AS build
ARG PIP_CERT
RUN apt-get update \
 && apt-get install --yes --no-install-recommends ccache g++ make git python3 python3-dev python3-venv \
 && rm -rf /var/lib/apt/lists/*
WORKDIR /src
COPY requirements-dev.lock ./
# The build's own tools first: they change less often than the sources.
RUN python3 -m venv /build \
 && /build/bin/pip install --no-cache-dir --disable-pip-version-check --no-compile -c requirements-dev.lock \
      scikit-build-core nanobind cmake ninja
COPY pyproject.toml LICENSE NOTICE README.md ./
COPY renderer renderer
COPY service service
COPY schemas/usd schemas/usd
ARG EXTRAS=server,postgres,otel,denoise,s3
# What was compiled is found again by the next build, if its sources are the same.
RUN --mount=type=cache,target=/ccache \
    PATH="/build/bin:$PATH" CXX=g++ CMAKE_CXX_COMPILER_LAUNCHER=ccache CCACHE_DIR=/ccache \
    /build/bin/pip wheel --no-cache-dir --disable-pip-version-check --no-deps --no-build-isolation \
      --wheel-dir /wheels . \
 && python3 -m venv /opt/primray \
 && /opt/primray/bin/pip install --no-cache-dir --disable-pip-version-check -c requirements-dev.lock \
      "$(ls /wheels/*.whl)[$EXTRAS]" \
 && rm -rf /opt/primray/lib/python3*/site-packages/pip*
# The list of what is inside (CycloneDX), for who has to know: docker run --entrypoint cat primray /opt/primray/share/sbom.cdx.json
RUN python3 -m venv /sbom \
 && /sbom/bin/pip install --no-cache-dir --disable-pip-version-check --no-compile "cyclonedx-bom==7.5.0" \
 && mkdir -p /opt/primray/share \
 && /sbom/bin/cyclonedx-py environment --output-format JSON --output-file /opt/primray/share/sbom.cdx.json \
      /opt/primray/bin/python

FROM docker.io/library/debian:12-slim
RUN apt-get update \
 && apt-get install --yes --no-install-recommends bubblewrap ca-certificates python3 \
 && rm -rf /var/lib/apt/lists/* \
 && install -d -o 65534 -g 65534 /data
COPY --from=build /opt/primray /opt/primray
ENV PATH="/opt/primray/bin:$PATH" PYTHONUNBUFFERED=1 HOME=/tmp
USER 65534:65534
VOLUME /data
EXPOSE 8700
# Ready means: database, disk, executor and the sandbox's own test. /readyz needs no key.
HEALTHCHECK --interval=15s --timeout=5s --start-period=20s --retries=3 \
  CMD ["python3", "-c", "import urllib.request as u; u.urlopen('http://127.0.0.1:8700/readyz', timeout=4)"]
STOPSIGNAL SIGTERM
ENTRYPOINT ["primray"]
CMD ["serve", "--host", "0.0.0.0", "--port", "8700", "--data", "/data"]
