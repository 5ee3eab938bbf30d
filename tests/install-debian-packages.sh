#!/bin/sh
# Installs what the tests need beside Python: a browser, a screen, FFmpeg, ROS 1. Elsewhere than on
# Debian it only says what that is.
set -eu
packages=$(cat "$(dirname "$0")/debian-packages.txt")
if ! command -v apt-get >/dev/null; then
    echo "not Debian: the tests want these programs installed:" $packages
    exit 0
fi
# shellcheck disable=SC2086
if dpkg-query -W -f '${Status}\n' $packages 2>/dev/null | grep -vq 'ok installed' ||
    ! dpkg-query -W $packages >/dev/null 2>&1; then
    sudo=$([ "$(id -u)" = 0 ] || echo sudo)
    $sudo apt-get update -q
    $sudo env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends $packages
fi
