#!/bin/sh
# Debian packages of what deploy/install.sh and edges/c/install lay down: see usage below. docs/operating.md says why not cargo-deb.
set -eu

usage() {
    cat <<'END'
Builds admittanced (daemon, tools, units, manual pages, completions, examples), libadmittance-client1 and libadmittance-client-dev.

Usage: DEBEMAIL=ADDRESS package.sh [--binaries DIR] [--archive FILE] [--version VERSION] OUTPUT

  OUTPUT             directory for the packages; it has to be there
  --binaries DIR     the built programs; default: target/release of this tree, or of CARGO_TARGET_DIR
  --archive FILE     the C client, libadmittance_client_c.a; default: that of the same directory
  --version VERSION  of the packages, such as 0.2.0+cell3; default: the version in Cargo.toml
  DEBEMAIL           address of who makes them, DEBFULLNAME the name

It wants dpkg-deb, binutils, cc and systemd-sysusers; no root.
Exit codes: 0 done, 64 usage, 66 a file is missing, 69 a program is missing.

Example: cargo build --release --workspace && DEBEMAIL=me@our-cell.net deploy/package.sh /tmp
END
}

# fail CODE MESSAGE
fail() {
    echo "package.sh: $2" >&2
    exit "$1"
}

source=$(cd -P "$(dirname "$0")/.." && pwd)
binaries=${CARGO_TARGET_DIR:-$source/target}/release
archive=
output=
version=$(sed -n 's/^version = "\(.*\)"/\1/p' "$source/Cargo.toml" | head -n 1)
while [ $# -gt 0 ]; do
    case $1 in
        --binaries | --archive | --version)
            [ $# -ge 2 ] || fail 64 "$1: a value is missing; see --help"
            case $1 in
                --binaries) binaries=$2 ;;
                --archive) archive=$2 ;;
                --version) version=$2 ;;
            esac
            shift
            ;;
        --help | -h)
            usage
            exit 0
            ;;
        -*) fail 64 "$1: not an option; see --help" ;;
        *)
            [ -z "$output" ] || fail 64 "$1: one OUTPUT is enough; see --help"
            output=$1
            ;;
    esac
    shift
done
[ -n "$output" ] || fail 64 "OUTPUT: a directory is missing; see --help"
[ -d "$output" ] || fail 66 "OUTPUT $output: not a directory"
archive=${archive:-$binaries/libadmittance_client_c.a}
[ -f "$archive" ] || fail 66 "$archive: not there; build it (cargo build --release --workspace) or give --archive"
[ -n "${DEBEMAIL:-}" ] || fail 64 "DEBEMAIL: not set; accepted: the address of who makes the packages"
for program in dpkg-deb strip objdump cc systemd-sysusers; do
    command -v "$program" >/dev/null || fail 69 "$program: not there; it belongs to dpkg, binutils, gcc or systemd"
done

# The same sources give the same packages.
if [ -z "${SOURCE_DATE_EPOCH:-}" ]; then
    SOURCE_DATE_EPOCH=$(git -C "$source" log -1 --format=%ct 2>/dev/null || date +%s)
fi
export SOURCE_DATE_EPOCH
maintainer="${DEBFULLNAME:-admittanced} <$DEBEMAIL>"
architecture=$(dpkg --print-architecture)
triplet=$(cc -print-multiarch)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
chmod 0755 "$work"

# glibc FILE...: the newest version of glibc that one of them wants.
glibc() {
    objdump -T "$@" | sed -n 's/.*GLIBC_\([0-9.]*\).*/\1/p' | sort -V | tail -n 1
}

# documents ROOT PACKAGE
documents() {
    documents=$1/usr/share/doc/$2
    mkdir -p "$documents"
    {
        cat "$source/deploy/debian/copyright"
        sed -e '1,2d' -e 's/^$/./' -e 's/^/ /' "$source/LICENSE-MIT"
    } >"$documents/copyright"
    printf '%s (%s) unstable; urgency=medium\n\n  * CHANGELOG.md of the sources says what has changed.\n\n -- %s  %s\n' \
        "$2" "$version" "$maintainer" "$(LC_ALL=C date -R -u -d "@$SOURCE_DATE_EPOCH")" | gzip -9n >"$documents/changelog.gz"
}

# package ROOT NAME SECTION DEPENDS: its description is on stdin, a line of summary first.
package() {
    documents "$1" "$2"
    mkdir -p "$1/DEBIAN"
    {
        printf 'Package: %s\nVersion: %s\nArchitecture: %s\nMaintainer: %s\n' "$2" "$version" "$architecture" "$maintainer"
        printf 'Section: %s\nPriority: optional\nDepends: %s\nInstalled-Size: %s\n' "$3" "$4" "$(du -sk "$1" | cut -f 1)"
        sed -e '1s/^/Description: /' -e '2,$s/^/ /'
    } >"$1/DEBIAN/control"
    (cd "$1" && find usr -type f | LC_ALL=C sort | xargs md5sum) >"$1/DEBIAN/md5sums"
    find "$1" -type d -exec chmod 0755 {} +
    dpkg-deb --root-owner-group --build "$1" "$output"
}

# As install.sh lays it down, with the prefix of packages.
daemon=$work/admittanced
mkdir -p "$daemon/etc" "$daemon/usr"
touch "$daemon/etc/passwd" "$daemon/etc/group" "$daemon/etc/shadow" "$daemon/etc/gshadow"
"$source/deploy/install.sh" --root "$daemon" --binaries "$binaries" >/dev/null
find "$daemon/etc" -type f -exec rm -f {} +
rm "$daemon/usr/local/share/admittanced/manifest"
mv "$daemon"/usr/local/* "$daemon/usr"
rmdir "$daemon/usr/local"
mv "$daemon/usr/share/zsh/site-functions" "$daemon/usr/share/zsh/vendor-completions"
find "$daemon/usr/lib" "$daemon/usr/share/admittanced" -type f -exec sed -i 's#/usr/local\b#/usr#g' {} +
find "$daemon/usr/share/man" -type f -exec gzip -9n {} +
strip --strip-unneeded "$daemon"/usr/bin/*
mkdir "$daemon/DEBIAN"
for script in preinst postinst prerm postrm; do
    install -m 0755 "$source/deploy/debian/$script" "$daemon/DEBIAN/$script"
done
package "$daemon" admittanced science "libc6 (>= $(glibc "$daemon"/usr/bin/*)), libgcc-s1, passwd, systemd" <<'END'
real-time admittance control of velocity-controlled robot arms
Lets an arm touch stiff surfaces at speed: each cycle it predicts the contact
with a small MPC, keeps the force between a minimum and a maximum, and knows
when that is impossible. It meets the motion controller in shared memory.
.
The daemon, the operator's tool admittancectl, admittance-egm, which speaks
Externally Guided Motion with ABB robots, and plant-sim, which emulates motion
controller and robot. They need an x86-64-v3 processor. It is not a
safety-rated device.
END

"$source/edges/c/install" "$work/client" "$archive"
library=$work/libadmittance-client1
development=$work/libadmittance-client-dev
mkdir -p "$library/usr/lib/$triplet" "$library/DEBIAN" "$development/usr/lib/$triplet"
mv "$work"/client/lib/libadmittance_client.so.* "$library/usr/lib/$triplet"
mv "$work/client/lib/pkgconfig" "$work"/client/lib/libadmittance_client.* "$development/usr/lib/$triplet"
mv "$work/client/include" "$development/usr"
sed -i -e 's#^prefix=.*#prefix=/usr#' -e "s#^libdir=.*#libdir=\${prefix}/lib/$triplet#" \
    "$development/usr/lib/$triplet/pkgconfig/admittance_client.pc"
chmod 0644 "$library/usr/lib/$triplet"/*
strip --strip-unneeded "$library/usr/lib/$triplet"/*
strip --strip-debug "$development/usr/lib/$triplet/libadmittance_client.a"
echo "libadmittance_client 1 libadmittance-client1 (>= $version)" >"$library/DEBIAN/shlibs"
echo "activate-noawait ldconfig" >"$library/DEBIAN/triggers"
package "$library" libadmittance-client1 libs "libc6 (>= $(glibc "$library/usr/lib/$triplet"/*)), libgcc-s1" <<'END'
motion controller's side of admittanced, shared library
Publishes state samples, takes the daemon's answers and says what the joints
are to follow, without allocation or waiting in the cycle.
END
package "$development" libadmittance-client-dev libdevel "libadmittance-client1 (= $version)" <<'END'
motion controller's side of admittanced, for C and C++
Headers, static library and pkg-config file of the client: it publishes state
samples, takes the daemon's answers and says what the joints are to follow.
END
