# mechanism_sim for where it has no wheels, Windows and macOS among them (README, "Start").
FROM debian:bookworm-slim

RUN apt-get update \
    && apt-get install --yes --no-install-recommends python3 python3-venv socat \
    && rm -rf /var/lib/apt/lists/*

COPY . /source
RUN python3 -m venv /opt/mechanism_sim \
    && /opt/mechanism_sim/bin/pip install --no-cache-dir '/source[all]' \
    && rm -r /source
ENV PATH=/opt/mechanism_sim/bin:$PATH

# What is compiled once is in the image already.
RUN mechanism-sim solve four_bar_clearance --revolutions 1

# The pages of `edit` and `view` are served to the machine they run on, which is the container:
# what comes to its address is handed on to them.
RUN printf '%s\n' '#!/bin/sh' \
    'here=$(hostname -I | cut -d" " -f1)' \
    '[ -z "$here" ] || socat "TCP-LISTEN:8080,bind=$here,fork,reuseaddr" TCP:127.0.0.1:8080 &' \
    'exec mechanism-sim "$@"' > /usr/local/bin/serve-and-run \
    && chmod +x /usr/local/bin/serve-and-run

EXPOSE 8080
WORKDIR /work
ENTRYPOINT ["serve-and-run"]
