# Sourced by what needs a Debian where nothing of this one is: in a folder, as root, with debootstrap.
#
#     new_debian SUITE   makes it in $work/debian, a folder that goes when the script ends
#     inside COMMAND...  runs a command there

work=$(mktemp -d)
root=$work/debian
cleanup() {
    for folder in dev/pts dev/shm proc; do
        if mountpoint -q "$root/$folder"; then umount "$root/$folder"; fi
    done
    rm -rf --one-file-system "$work"
}
trap cleanup EXIT

say() { printf '== %s\n' "$*"; }

new_debian() {
    local suite=$1 own mirror
    own=$(. /etc/os-release && echo "$VERSION_CODENAME")
    mirror=$(apt-get indextargets --format '$(SITE) $(RELEASE) $(CREATED_BY)' | awk -v s="$own" '$2 == s && $3 == "Packages" { print $1; exit }')
    debootstrap --variant=minbase "$suite" "$root" "$mirror" >"$work/debootstrap.log" || { tail "$work/debootstrap.log"; exit 1; }
    cp /etc/apt/apt.conf.d/* "$root/etc/apt/apt.conf.d/"
    cp /etc/resolv.conf "$root/etc/resolv.conf"
    mount -t proc proc "$root/proc"
    mount -t devpts devpts "$root/dev/pts"
    mount -t tmpfs tmpfs "$root/dev/shm"
}
inside() { chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root DEBIAN_FRONTEND=noninteractive "$@"; }
