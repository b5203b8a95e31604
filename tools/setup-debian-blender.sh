#!/usr/bin/env bash
# Install a Blender with a window on a Debian machine without one, for tests/gui.
#
#   sudo tools/setup-debian-blender.sh [DIR]
#
# DIR (default ~/.cache/dyehouse/blender) gets a Debian sid chroot in DIR/root, 1.2 GB, with Blender, Xvfb, xdotool,
# ImageMagick, numpy and OpenImageIO, and two commands in DIR/bin:
#
#   blender ARGS...          Blender from the chroot; on a virtual display when ARGS ask for a window and DISPLAY is unset
#   blender-root CMD ARGS... any command of the chroot (Xvfb, xdotool, import, python3)
#
# Both see, at the same paths as outside, the git work tree of the current folder (or that folder), /tmp, TMPDIR, and each
# folder in BLENDER_BIND (colon-separated). The mounts live in a mount namespace of their own, so they vanish with the
# process, whatever ends it, and many commands can run at once.
#
# Run again, it goes on where it stopped; complete, it takes a second. The mirror is the one that apt is configured with.
set -euo pipefail

[ "$(id -u)" = 0 ] || { echo "setup-debian-blender: needs root" >&2; exit 1; }
command -v apt-get >/dev/null || { echo "setup-debian-blender: needs a machine with apt" >&2; exit 1; }
dir=$(realpath -m "${1:-${XDG_CACHE_HOME:-$HOME/.cache}/dyehouse/blender}")
root=$dir/root bin=$dir/bin
packages="blender xvfb xauth xdotool imagemagick libgl1-mesa-dri libegl1 python3-numpy python3-openimageio"
# Debian's Blender does not depend on these, but its own extension add-on imports them.
packages="$packages python3-cattr python3-requests python3-zstandard"
say() { echo "setup-debian-blender: $*"; }
logged() { "$@" >"$dir/log" 2>&1 || { tail -n 20 "$dir/log" >&2; exit 1; }; }
mkdir -p "$bin"

# --- the base system ---
if [ ! -e "$root/.base-complete" ]; then
    command -v debootstrap >/dev/null || {
        apt-get update -qq
        apt-get install -y -qq --no-install-recommends debootstrap >/dev/null
    }
    code=$(. /etc/os-release && echo "$VERSION_CODENAME")
    mirror() { apt-get indextargets --format '$(RELEASE) $(REPO_URI)' 2>/dev/null |
               awk -v c="$code" '$1 == c {print $2; exit}'; }
    uri=$(mirror)
    [ -n "$uri" ] || { apt-get update -qq; uri=$(mirror); }
    [ -n "$uri" ] || { echo "setup-debian-blender: apt has no mirror for $code" >&2; exit 1; }
    rm -rf --one-file-system "$root"
    mkdir -p "$root"
    say "debootstrap sid into $root"
    logged debootstrap --variant=minbase sid "$root" "$uri"
    echo "deb $uri sid main" >"$root/etc/apt/sources.list"
    # The same proxy and date rules that apt has outside.
    apt-config dump | grep -E '^Acquire::((https?::Proxy|Retries|Check-Valid-Until|Check-Date) )' \
        >"$root/etc/apt/apt.conf.d/90outside" || true
    # Smaller and faster: no manuals, no translations, no fsync per file.
    printf '%s\n' 'path-exclude=/usr/share/doc/*' 'path-exclude=/usr/share/man/*' \
        'path-exclude=/usr/share/locale/*' 'path-exclude=/usr/share/info/*' force-unsafe-io \
        >"$root/etc/dpkg/dpkg.cfg.d/small"
    ln -sf ../proc/self/mounts "$root/etc/mtab"
    printf '#!/bin/sh\nexit 101\n' >"$root/usr/sbin/policy-rc.d"   # start no services
    chmod +x "$root/usr/sbin/policy-rc.d"
    touch "$root/.base-complete"
fi

# --- the two commands ---
cat >"$bin/blender-root" <<'WRAPPER'
#!/usr/bin/env bash
# Run a command of the Blender chroot; written by setup-debian-blender.sh.
set -euo pipefail
root=@ROOT@
if [ -z "${_BLENDER_NS:-}" ]; then
    exec env _BLENDER_NS=1 unshare --mount --propagation private "$0" "$@"
fi
unset _BLENDER_NS
here=$(pwd -P)
work=$(git -C "$here" rev-parse --show-toplevel 2>/dev/null || echo "$here")
mount -t proc proc "$root/proc"
mount --rbind /dev "$root/dev"
mount --rbind /sys "$root/sys"
bind() {                       # make folder $1 visible inside at the same path
    local d
    d=$(realpath -e -- "$1" 2>/dev/null) || return 0
    case $d in /|/usr*|/etc*|/lib*|/bin*|/sbin*|/var|/proc*|/dev*|/sys*) return 0 ;; esac
    mkdir -p "$root$d"
    mount --bind "$d" "$root$d"
}
bind /tmp
bind "${TMPDIR:-/tmp}"
bind "$work"
bind "$here"
IFS=: read -ra more <<<"${BLENDER_BIND:-}"
for d in "${more[@]:-}"; do [ -z "$d" ] || bind "$d"; done
# Programs outside may need variables that would break those inside.
unset PYTHONHOME PYTHONPATH LD_LIBRARY_PATH LD_PRELOAD
export PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
export HOME=${BLENDER_HOME:-/root} LC_ALL=C.UTF-8
exec chroot "$root" /usr/bin/env --chdir="$here" "$@"
WRAPPER
cat >"$bin/blender" <<'WRAPPER'
#!/usr/bin/env bash
# Blender from the chroot; written by setup-debian-blender.sh.
set -euo pipefail
window=1
for a in "$@"; do
    case $a in
        --) break ;;
        -b|--background|-c|--command|-h|--help|-v|--version) window= ;;
    esac
done
if [ -n "$window" ] && [ -z "${DISPLAY:-}" ]; then
    # Software OpenGL: Vulkan and the hardware path need a real GPU.
    export LIBGL_ALWAYS_SOFTWARE=1
    exec @BIN@/blender-root xvfb-run -a -s "-screen 0 1600x1000x24 +extension GLX" blender --gpu-backend opengl "$@"
fi
exec @BIN@/blender-root blender "$@"
WRAPPER
sed -i "s#@ROOT@#$root#; s#@BIN@#$bin#" "$bin/blender-root" "$bin/blender"
chmod +x "$bin/blender-root" "$bin/blender"

# --- Blender ---
if [ "$(cat "$root/.packages" 2>/dev/null)" != "$packages" ]; then
    cp -L /etc/resolv.conf /etc/hosts "$root/etc/" 2>/dev/null || true
    say "installing $packages"
    export DEBIAN_FRONTEND=noninteractive
    cd /                       # so that no work tree is bound while packages unpack
    "$bin/blender-root" dpkg --configure -a >/dev/null 2>&1 || true    # after an interruption
    logged "$bin/blender-root" apt-get update -qq
    logged "$bin/blender-root" apt-get install -y -qq --no-install-recommends $packages
    "$bin/blender-root" apt-get clean
    echo "$packages" >"$root/.packages"
fi
rm -f "$dir/log"
cd /
say "$("$bin/blender" --version | head -n 1) is $bin/blender"
