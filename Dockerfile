# motorid's HTTP service: without root, read-only but for /data, and without a network of its own.
#
#   docker build --tag motorid .
#   docker run --read-only --cap-drop ALL --volume motorid:/data --publish 8000:8000 motorid

# The tag says what it is and the digest which one; `make image-base` renews the digest.
ARG BASE=python:3.13-slim-bookworm@sha256:cbd229d7b9bd041012af758ce5ffd807a6518d76493ce9035d208f1db9ceff1e

FROM ${BASE} AS build

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


FROM build AS site

# The tools of the documentation stay behind in this stage.  The site links to some of the files
# below by their paths, and its build checks that they exist.  The references that it generates need
# the installed package, whose version they state.
COPY requirements/dev.txt requirements/
RUN pip install --require-hashes --only-binary :all: --requirement requirements/dev.txt
COPY mkdocs.yml Dockerfile ./
COPY docs docs
COPY bench bench
COPY benchmarks benchmarks
COPY data data
RUN pip install --no-deps wheel/*.whl \
    && NO_MKDOCS_2_WARNING=1 python -m mkdocs build --quiet --strict --site-dir /opt/help


FROM ${BASE}

# tini is PID 1: it hands signals on and reaps what a killed fit leaves behind.
# The base comes without compiled modules, and below a read-only root none are ever written.
RUN apt-get update \
    && apt-get install --yes --no-install-recommends "tini=0.19.0-*" \
    && rm -rf /var/lib/apt/lists/* \
    && python -c "import compileall, sysconfig; compileall.compile_dir(sysconfig.get_path('stdlib'), quiet=2)" \
    && install --directory --owner 10001 --group 10001 --mode 0700 /data

COPY --from=build /opt/motorid /opt/motorid
COPY --from=site /opt/help /opt/help

# The root may be read-only, so everything that is written goes to the volume.
# `docker stop` kills after 10 s, so requests may take half of that to end.
ENV PATH=/opt/motorid/bin:$PATH \
    PYTHONDONTWRITEBYTECODE=1 \
    PYTHONUNBUFFERED=1 \
    MOTORID_HOST=0.0.0.0 \
    MOTORID_PORT=8000 \
    MOTORID_DATA_DIR=/data \
    MOTORID_HELP_DIR=/opt/help \
    MOTORID_SHUTDOWN_S=5 \
    HOME=/data \
    TMPDIR=/data
WORKDIR /data
VOLUME /data
USER 10001:10001
EXPOSE 8000

HEALTHCHECK --interval=10s --timeout=5s --start-period=60s --retries=3 \
    CMD ["python", "-P", "-m", "app.health.probe"]

ENTRYPOINT ["/usr/bin/tini", "--"]
CMD ["motorid", "serve"]
