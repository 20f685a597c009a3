#!/usr/bin/env bash
# Build RoboVAST's run images, and push them when asked to.
#
#   container/build.sh [--push | --release] [--slim|--full|--agent] [--core] [--base IMAGE] [--tag TAG] [-- BUILD-OPTION...]
#
#   --push        push every image that was built
#   --release     push every image for amd64 and arm64, with SBOM and provenance; metadata-*.json gets the digests
#   --slim        only the image without ROS (container/slim)
#   --full        only the image with ROS 2 Jazzy (container/robovast)
#   --agent       only the image of the operator and of our containers beside runs (container/agent)
#   --core        the agent's image without what floor plans, paths and ROS bags need: smaller
#   --base IMAGE  build on this image instead of the Dockerfile's own base
#   --tag TAG     default: latest; the slim image gets TAG-slim, the agent's TAG-agent
#   --            what follows goes to `docker build`
#
# Environment: DOCKER (default docker; any client with its commands, such as podman) and
# ROBOVAST_REGISTRY (default localhost:5000, the registry of minikube's addon).
set -euo pipefail
cd "$(dirname "$0")"

usage() {
    sed -n '2,/^set /{/^set /d; s/^# \{0,1\}//; p}' build.sh
}

docker=${DOCKER:-docker}
repository=${ROBOVAST_REGISTRY:-localhost:5000}/robovast
push=false
release=false
tag=latest
lock=agent
kinds=(robovast slim agent)
options=()

while [ $# -gt 0 ]; do
    case $1 in
        --push) push=true ;;
        --release) release=true ;;
        --slim) kinds=(slim) ;;
        --full) kinds=(robovast) ;;
        --agent) kinds=(agent) ;;
        --core) lock=agent-core ;;
        --base | --tag)
            [ $# -ge 2 ] || { echo "build.sh: $1 needs a value" >&2; exit 2; }
            if [ "$1" = --tag ]; then tag=$2; else options+=(--build-arg "BASE_IMAGE=$2"); fi
            shift
            ;;
        -h | --help) usage; exit 0 ;;
        --) shift; options+=("$@"); break ;;
        *) echo "build.sh: unknown option $1 (see --help)" >&2; exit 2 ;;
    esac
    shift
done

# The agent's image has this RoboVAST inside.
add_wheel() {
    cp "../requirements/$lock.txt" agent/requirements.txt
    rm -f agent/robovast_operator-*.whl
    if command -v uv >/dev/null; then
        uv build --quiet --wheel --out-dir agent ..
    else
        python3 -m pip wheel --quiet --no-deps --wheel-dir agent ..
    fi
}

# What the image is and where it comes from, as registries show it.
labels() { # TITLE
    printf -- '--label\norg.opencontainers.image.%s\n' "title=$1" "version=$tag" licenses=Apache-2.0 \
        source=https://github.com/robovast/robovast
    local revision
    if revision=$(git rev-parse HEAD 2>/dev/null); then
        printf -- '--label\norg.opencontainers.image.revision=%s\n' "$revision"
    fi
}

for kind in "${kinds[@]}"; do
    image=$repository:$tag
    [ "$kind" = robovast ] || image=$image-$kind
    [ "$kind" != agent ] || add_wheel
    mapfile -t labels < <(labels "RoboVAST $kind")
    build=(build)
    if [ "$release" = true ]; then
        build=(buildx build "--platform=linux/amd64,linux/arm64" --sbom=true --provenance=mode=max --push
            --metadata-file "metadata-$kind.json")
    fi
    "$docker" "${build[@]}" "${labels[@]}" "${options[@]}" --tag "$image" "$kind"
    if [ "$push" = true ]; then
        "$docker" push "$image"
    fi
done
