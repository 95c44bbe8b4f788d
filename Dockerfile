# motorid's HTTP service: without root, read-only but for /data, and without a network of its own.
#
#   docker build --tag motorid .
#   docker run --read-only --cap-drop ALL --volume motorid:/data --publish 8000:8000 motorid
#
# To pin the base by digest as well, put `@sha256:...` of your registry behind both tags.

FROM python:3.13-slim-bookworm AS build

ENV PIP_DISABLE_PIP_VERSION_CHECK=1 \
    PIP_NO_CACHE_DIR=1 \
    PIP_NO_INPUT=1 \
    PIP_ROOT_USER_ACTION=ignore
WORKDIR /build

# Two environments: what builds the wheel stays behind, and so does pip.
COPY requirements/run.txt requirements/build.txt requirements/
RUN python -m venv --without-pip /opt/motorid \
    && python -m venv --without-pip tools \
    && pip --python /opt/motorid/bin/python install \
        --require-hashes --only-binary :all: --requirement requirements/run.txt \
    && pip --python tools/bin/python install \
        --require-hashes --only-binary :all: --requirement requirements/build.txt

COPY pyproject.toml README.md LICENSE ./
COPY identification identification
COPY motorid motorid
COPY app app
RUN tools/bin/python -m hatchling build --target wheel --directory wheel \
    && pip --python /opt/motorid/bin/python install --no-deps wheel/*.whl


FROM python:3.13-slim-bookworm

# tini is PID 1: it hands signals on and reaps what a killed fit leaves behind.
RUN apt-get update \
    && apt-get install --yes --no-install-recommends "tini=0.19.0-*" \
    && rm -rf /var/lib/apt/lists/* \
    && install --directory --owner 10001 --group 10001 --mode 0700 /data

COPY --from=build /opt/motorid /opt/motorid

# The root may be read-only, so everything that is written goes to the volume.
ENV PATH=/opt/motorid/bin:$PATH \
    PYTHONDONTWRITEBYTECODE=1 \
    PYTHONUNBUFFERED=1 \
    MOTORID_DATA_DIR=/data \
    HOME=/data \
    TMPDIR=/data
WORKDIR /data
VOLUME /data
USER 10001:10001
EXPOSE 8000

HEALTHCHECK --interval=10s --timeout=5s --start-period=30s --retries=3 \
    CMD ["python", "-c", "import urllib.request as u; u.urlopen('http://127.0.0.1:8000/healthz', timeout=4)"]

ENTRYPOINT ["/usr/bin/tini", "--"]
CMD ["motorid", "serve", "--host", "0.0.0.0", "--port", "8000"]
