#!/bin/sh
# Lays admittanced down beside systemd, and takes it away again: see usage below.
set -eu

usage() {
    cat <<'END'
Installs what operators need below /usr/local: admittanced, admittancectl, plant-sim (for rehearsals), admittance-egm (for ABB robots),
their manual pages and shell completions, units, the user admittanced and example files. admittance-lab, which developers measure
with, is not installed.

Usage: install.sh [--root DIR] [--binaries DIR]
       install.sh --uninstall [--purge] [--root DIR]

  --root DIR      a file system to install into, such as an image's; default: this machine, where it needs root
  --binaries DIR  the built programs; default: target/release of this tree, or of CARGO_TARGET_DIR
  --uninstall     stop all instances and remove what was installed; /etc/admittanced, recordings in /var/lib/admittanced and the
                  user stay
  --purge         with --uninstall: remove both directories, their files included, and the user as well

An installation over another one replaces it; running daemons go on with the old program until they are restarted.
Exit codes: 0 done, 64 usage, 66 a file is missing, 69 no systemd, 77 no permission.

Example: cargo build --release --workspace --bins && sudo deploy/install.sh
END
}

# fail CODE MESSAGE
fail() {
    echo "install.sh: $2" >&2
    exit "$1"
}

source=$(cd -P "$(dirname "$0")/.." && pwd)
binaries=${CARGO_TARGET_DIR:-$source/target}/release
root=
uninstall=
purge=
while [ $# -gt 0 ]; do
    case $1 in
        --root | --binaries)
            [ $# -ge 2 ] || fail 64 "$1: a directory is missing; see --help"
            [ -d "$2" ] || fail 66 "$1 $2: not a directory"
            path=$(cd -P "$2" && pwd)
            if [ "$1" = --root ]; then root=${path%/}; else binaries=$path; fi
            shift
            ;;
        --uninstall) uninstall=yes ;;
        --purge) purge=yes ;;
        --help | -h)
            usage
            exit 0
            ;;
        *) fail 64 "$1: not an option; see --help" ;;
    esac
    shift
done
[ -z "$purge" ] || [ -n "$uninstall" ] || fail 64 "--purge: only with --uninstall"
[ -n "$root" ] || [ "$(id -u)" = 0 ] || fail 77 "needs root, or --root DIR"

share=/usr/local/share/admittanced
# What was made, directories included, in the order of making.
manifest=$root$share/manifest

# Whether the systemd that runs here is that of the root.
is_live() {
    [ -z "$root" ] && [ -d /run/systemd/system ]
}

made() {
    made="${made:+$made
}$1"
}

# directory PATH: made if it is not there, with its parents.
directory() {
    if [ ! -d "$root$1" ]; then
        [ "$1" = / ] || directory "$(dirname "$1")"
        mkdir -m 0755 "$root$1"
        made "$1"
    fi
}

# file MODE SOURCE PATH
file() {
    directory "$(dirname "$3")"
    install -m "$1" "$2" "$root$3"
    made "$3"
}

# Removes what the manifest lists, last first; a directory only when nothing else has come into it.
remove_files() {
    [ -f "$manifest" ] || return 0
    tac "$manifest" | while IFS= read -r path; do
        if [ -d "$root$path" ]; then
            rmdir --ignore-fail-on-non-empty "$root$path"
        else
            rm -f "$root$path"
        fi
    done
}

install_files() {
    for program in admittanced admittancectl plant-sim admittance-egm; do
        [ -x "$binaries/$program" ] ||
            fail 66 "$binaries/$program: not there; build it (cargo build --release --workspace --bins) or give --binaries"
    done
    command -v systemd-sysusers >/dev/null || fail 69 "systemd-sysusers: not there; it belongs to systemd"
    # Manual pages and completions, of the programs that are installed.
    written=$(mktemp -d)
    trap 'rm -rf "$written"' EXIT
    "$binaries/admittancectl" installed-files "$written" || fail 69 "$binaries/admittancectl: does not run here"
    remove_files
    made=
    directory /etc/admittanced
    for program in admittanced admittancectl plant-sim admittance-egm; do
        file 0755 "$binaries/$program" "/usr/local/bin/$program"
    done
    for unit in admittanced@.service plant-sim@.service admittance-egm@.service; do
        file 0644 "$source/deploy/systemd/$unit" "/usr/local/lib/systemd/system/$unit"
        file 0644 "$source/deploy/systemd/sandbox.conf" "/usr/local/lib/systemd/system/$unit.d/sandbox.conf"
    done
    file 0644 "$source/deploy/systemd/udp.conf" /usr/local/lib/systemd/system/admittance-egm@.service.d/udp.conf
    file 0644 "$source/deploy/systemd/sysusers.conf" /usr/local/lib/sysusers.d/admittanced.conf
    file 0644 "$source/deploy/systemd/udev.rules" /usr/local/lib/udev/rules.d/60-admittanced.rules
    for example in "$source"/deploy/robots/*.toml; do
        file 0644 "$example" "$share/robots/${example##*/}"
    done
    for example in "$source"/deploy/egm/*.toml; do
        file 0644 "$example" "$share/egm/${example##*/}"
    done
    for example in "$source"/plant-sim/scenarios/*.toml; do
        file 0644 "$example" "$share/scenarios/${example##*/}"
    done
    for page in deploy/TUNING.md deploy/THREATS.md docs/faults.md docs/egm.md; do
        file 0644 "$source/$page" "$share/${page##*/}"
    done
    for page in $(cd "$written" && find . -type f | sort); do
        file 0644 "$written/$page" "/usr/local/share/${page#./}"
    done
    made "$share/manifest"
    printf '%s\n' "$made" >"$manifest"
    # Run by hand: without it the user would come with the next boot only.
    systemd-sysusers ${root:+"--root=$root"} "$root/usr/local/lib/sysusers.d/admittanced.conf"
}

# Where udev runs, its device's group follows the rule at once.
reload_udev() {
    if is_live && command -v udevadm >/dev/null && [ -e /run/udev/control ]; then
        udevadm control --reload
        udevadm trigger --name-match=cpu_dma_latency
    fi
}

if [ -z "$uninstall" ]; then
    install_files
    if is_live; then systemctl daemon-reload; fi
    reload_udev
    echo "installed. Next: copy a file of $share/robots to /etc/admittanced/NAME.toml; systemctl enable --now admittanced@NAME"
    exit 0
fi

if is_live; then
    # The daemons first: in contact they stop at a low force as long as samples come.
    systemctl stop 'admittanced@*.service'
    systemctl stop 'plant-sim@*.service' 'admittance-egm@*.service'
    systemctl reset-failed 'admittanced@*.service' 'plant-sim@*.service' 'admittance-egm@*.service' 2>/dev/null || true
fi
if [ -f "$manifest" ]; then
    # Of the template: all its instances.
    if command -v systemctl >/dev/null; then systemctl ${root:+"--root=$root"} disable --quiet admittanced@.service admittance-egm@.service; fi
fi
remove_files
if [ -n "$purge" ]; then
    rm -rf "$root/etc/admittanced" "$root/var/lib/admittanced"
    if grep -qs '^admittanced:' "$root/etc/passwd"; then userdel ${root:+--prefix "$root"} admittanced; fi
    # With the user in most distributions.
    if grep -qs '^admittanced:' "$root/etc/group"; then groupdel ${root:+--prefix "$root"} admittanced; fi
fi
if is_live; then
    rm -rf /run/admittanced
    systemctl daemon-reload
fi
reload_udev
if [ -n "$purge" ]; then echo "removed"; else echo "removed; /etc/admittanced, /var/lib/admittanced and the user admittanced stay (--purge)"; fi
