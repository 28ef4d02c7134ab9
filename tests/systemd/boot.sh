# Boots a systemd of its own, apart from the machine's: boot.sh CGROUP REPOSITORY BINARIES, as root.
# It ends with SIGKILL, and all its processes with it; the caller removes the cgroup. /etc is a
# copy, /usr/local is empty, and the directories that programs write to are new: nothing done in
# there reaches the machine. /srv/repository is what a user has after a build.
set -eu
echo $$ >"$1/cgroup.procs"
exec unshare --fork --kill-child=KILL --pid --mount --uts --ipc --cgroup --mount-proc -- sh -euc '
mount --make-rprivate /
mount -t tmpfs tmpfs /srv
cp -a /etc /srv/etc
mkdir -p /srv/repository/plant-sim /srv/repository/target/release
cp -a "$0/deploy" "$0/docs" /srv/repository
cp -a "$0/plant-sim/scenarios" /srv/repository/plant-sim
for program in admittanced admittancectl plant-sim admittance-egm; do
    cp "$1/$program" /srv/repository/target/release
done
mount --bind /srv/etc /etc
mount -t tmpfs tmpfs /usr/local
umount -R /sys/fs/cgroup
mount -t cgroup2 cgroup2 /sys/fs/cgroup
for directory in /run /tmp /var/tmp /dev/shm /var/log /var/lib; do
    mount -t tmpfs -o "mode=$(stat -c %a "$directory")" tmpfs "$directory"
done
mkdir /var/lib/systemd
rm -rf /etc/systemd/system
mkdir -p /etc/systemd/system /etc/systemd/journald.conf.d
# The kernel speaks of the machine.
printf "%s\n" "[Journal]" ReadKMsg=no >/etc/systemd/journald.conf.d/test.conf
cd /etc/systemd/system
# What would touch the machine, or waits for what is not there.
for unit in systemd-sysctl.service systemd-modules-load.service systemd-binfmt.service systemd-sysusers.service \
    systemd-tmpfiles-setup.service systemd-tmpfiles-setup-dev.service systemd-tmpfiles-clean.timer \
    systemd-remount-fs.service systemd-update-utmp.service systemd-journal-flush.service \
    systemd-udevd.service systemd-udev-trigger.service systemd-udevd-control.socket systemd-udevd-kernel.socket \
    proc-sys-fs-binfmt_misc.automount sys-kernel-debug.mount sys-kernel-tracing.mount sys-fs-fuse-connections.mount \
    dev-hugepages.mount dev-mqueue.mount systemd-ask-password-console.path systemd-ask-password-wall.path \
    systemd-initctl.socket; do
    ln -s /dev/null "$unit"
done
printf "%s\n" "[Unit]" Requires=basic.target After=basic.target AllowIsolate=yes >booted.target
exec env -i container=test PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin \
    /lib/systemd/systemd --system --unit=booted.target --log-target=journal --show-status=false
' "$2" "$3"
