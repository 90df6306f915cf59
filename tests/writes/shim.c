/* Counts what a process writes below one folder, and makes one of these operations fail.
 *
 * Loaded with LD_PRELOAD; it does nothing before `writes_arm`, nor in a process that is forked behind it. An operation
 * is one of the calls below on a path in the watched folder that changes something there: to make a folder that is
 * there, or to take away what is not, is none. Each is logged, and behind it what it has made of its file. */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

enum kind { NONE, ERROR, SHORT, TORN, FULL, DENIED, KILL, CUT };
enum does { MAKES = 1, WRITES = 2, NAMES = 4, SYNCS = 8, MARKS = 16 }; /* what an operation is, for the kinds */

static char folder[PATH_MAX];
static size_t folder_length;
static int armed, log_fd = -1, at_number, number, kind, spent;
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;

static void forked(void) { armed = 0; }

__attribute__((constructor)) static void loaded(void) { pthread_atfork(NULL, NULL, forked); }

void writes_arm(const char *watched, int log, int of_number, int of_kind)
{
    snprintf(folder, sizeof folder, "%s", watched);
    folder_length = strlen(folder);
    log_fd = log, at_number = of_number, kind = of_kind;
    armed = 1;
}

/* The path in the watched folder, 0 where it is elsewhere. */
static const char *inside(const char *path)
{
    if (strncmp(path, folder, folder_length) || (path[folder_length] && path[folder_length] != '/')) return NULL;
    return path[folder_length] ? path + folder_length + 1 : ".";
}

static const char *of_fd(int fd, char *found)
{
    char name[64];
    snprintf(name, sizeof name, "/proc/self/fd/%d", fd);
    ssize_t length = readlink(name, found, PATH_MAX - 1);
    if (length < 0) return NULL;
    found[length] = 0;
    return inside(found);
}

static const char *of_path(int at, const char *path, char *found)
{
    char joined[2 * PATH_MAX] = "";
    if (path[0] != '/') {
        char base[64];
        if (at == AT_FDCWD) snprintf(base, sizeof base, "/proc/self/cwd");
        else snprintf(base, sizeof base, "/proc/self/fd/%d", at);
        ssize_t length = readlink(base, joined, PATH_MAX - 1);
        if (length < 0) return NULL;
        joined[length] = '/', joined[length + 1] = 0;
    }
    strncat(joined, path, PATH_MAX - 1);
    /* the folder of the name as the kernel sees it: the name itself need not be there, and may be a link */
    char *last = strrchr(joined, '/');
    char name[NAME_MAX + 2];
    snprintf(name, sizeof name, "%s", last);
    *last = 0;
    if (!realpath(*joined ? joined : "/", found)) return NULL;
    if (strcmp(name, "/") && strcmp(name, "/.") && strlen(found) + strlen(name) < PATH_MAX) strcat(found, name);
    return inside(found);
}

static void killed(int all)
{
    syscall(SYS_kill, all ? 0 : getpid(), SIGKILL);
    for (;;) syscall(SYS_pause);
}

static void note(char mark, const char *call, const char *path, ino_t file, long size)
{
    char line[PATH_MAX + 128];
    int length = snprintf(line, sizeof line, "%c\t%d\t%s\t%lu\t%ld\t%s\n", mark, number, call, (unsigned long)file,
                          size, path);
    syscall(SYS_write, log_fd, line, length);
}

/* Counts an operation. 0: let it pass, -1: write half of it, else the error that it fails with. */
static int met(const char *call, int does, const char *path)
{
    int error = 0;
    pthread_mutex_lock(&lock);
    int now = ++number == at_number;
    note('?', call, path, 0, does);
    if (now) note('!', call, path, 0, does);
    switch (kind) {
    case ERROR: error = now ? EIO : 0; break;
    case SHORT: error = now ? -1 : spent && does & (MAKES | WRITES) ? ENOSPC : 0; break;
    case TORN: error = now ? -1 : 0; break;
    case FULL: error = (now || spent) && does & (MAKES | WRITES) ? ENOSPC : 0; break;
    case DENIED: error = (now || spent) && does & (MAKES | NAMES | MARKS) ? EACCES : 0; break;
    case KILL:
    case CUT:
        if (now) killed(kind == CUT);
    }
    spent |= now;
    pthread_mutex_unlock(&lock);
    return error;
}

static void saw(char mark, const char *call, int fd, const char *path)
{
    struct stat found;
    if (!fstat(fd, &found)) note(mark, call, path, found.st_ino, (long)found.st_size);
}

/* ---------------------------------------------------------------------------------------------------------- opening */
static int opened(const char *call, int at, const char *path, int flags, mode_t mode)
{
    char found[PATH_MAX];
    const char *name = NULL;
    if (armed && flags & (O_WRONLY | O_RDWR) && flags & (O_CREAT | O_TRUNC) && (flags & O_TMPFILE) != O_TMPFILE
        && (name = of_path(at, path, found))) {
        char kept[PATH_MAX];
        snprintf(kept, sizeof kept, "%s", name);
        struct stat old;
        int there = !fstatat(at, path, &old, 0);
        int error = there && !(flags & O_TRUNC) && !(flags & O_EXCL) ? 0 : met(call, MAKES, kept);
        if (error > 0) return errno = error, -1;
        int fd = (int)syscall(SYS_openat, at, path, flags | O_LARGEFILE, mode);
        if (fd >= 0 && (!there || flags & O_TRUNC)) saw(there ? 't' : 'n', call, fd, kept);
        return fd;
    }
    return (int)syscall(SYS_openat, at, path, flags | O_LARGEFILE, mode);
}

#define OPEN(name) \
    int name(const char *path, int flags, ...) \
    { \
        va_list more; \
        va_start(more, flags); \
        mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(more, mode_t) : 0; \
        va_end(more); \
        return opened("open", AT_FDCWD, path, flags, mode); \
    }
#define OPEN_AT(name) \
    int name(int at, const char *path, int flags, ...) \
    { \
        va_list more; \
        va_start(more, flags); \
        mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(more, mode_t) : 0; \
        va_end(more); \
        return opened("open", at, path, flags, mode); \
    }
OPEN(open)
OPEN(open64)
OPEN_AT(openat)
OPEN_AT(openat64)
int __open_2(const char *path, int flags) { return opened("open", AT_FDCWD, path, flags, 0); }
int __open64_2(const char *path, int flags) { return opened("open", AT_FDCWD, path, flags, 0); }
int __openat_2(int at, const char *path, int flags) { return opened("open", at, path, flags, 0); }
int __openat64_2(int at, const char *path, int flags) { return opened("open", at, path, flags, 0); }
int creat(const char *path, mode_t mode) { return opened("open", AT_FDCWD, path, O_CREAT | O_WRONLY | O_TRUNC, mode); }
int creat64(const char *path, mode_t mode) { return creat(path, mode); }

/* ---------------------------------------------------------------------------------------------------------- writing */
#define WRITTEN(call, half, whole) \
    char found[PATH_MAX]; \
    const char *name = armed ? of_fd(fd, found) : NULL; \
    if (!name) return whole; \
    saw('b', call, fd, name); \
    int error = met(call, WRITES, name); \
    if (error > 0) return errno = error, -1; \
    ssize_t count = error < 0 ? half : whole; \
    saw('w', call, fd, name); \
    if (error < 0 && kind == TORN) killed(0); \
    return count

ssize_t write(int fd, const void *data, size_t size)
{
    WRITTEN("write", syscall(SYS_write, fd, data, (size + 1) / 2), syscall(SYS_write, fd, data, size));
}

static ssize_t written_at(int fd, const void *data, size_t size, off_t at)
{
    WRITTEN("pwrite", syscall(SYS_pwrite64, fd, data, (size + 1) / 2, at), syscall(SYS_pwrite64, fd, data, size, at));
}
ssize_t pwrite(int fd, const void *data, size_t size, off_t at) { return written_at(fd, data, size, at); }
ssize_t pwrite64(int fd, const void *data, size_t size, off64_t at) { return written_at(fd, data, size, at); }

ssize_t writev(int fd, const struct iovec *parts, int count_of)
{
    WRITTEN("writev", syscall(SYS_writev, fd, parts, (count_of + 1) / 2), syscall(SYS_writev, fd, parts, count_of));
}

ssize_t copy_file_range(int from, off64_t *at, int fd, off64_t *to, size_t size, unsigned flags)
{
    WRITTEN("copy", syscall(SYS_copy_file_range, from, at, fd, to, (size + 1) / 2, flags),
            syscall(SYS_copy_file_range, from, at, fd, to, size, flags));
}
static ssize_t sent(int fd, int from, off64_t *at, size_t size)
{
    WRITTEN("copy", syscall(SYS_sendfile, fd, from, at, (size + 1) / 2), syscall(SYS_sendfile, fd, from, at, size));
}
ssize_t sendfile(int fd, int from, off_t *at, size_t size) { return sent(fd, from, at, size); }
ssize_t sendfile64(int fd, int from, off64_t *at, size_t size) { return sent(fd, from, at, size); }

#define ON_FILE(call, does, mark, whole) \
    char found[PATH_MAX]; \
    const char *name = armed ? of_fd(fd, found) : NULL; \
    if (!name) return whole; \
    if (mark) saw('b', call, fd, name); \
    int error = met(call, does, name); \
    if (error > 0) return errno = error, -1; \
    int result = whole; \
    if (!result && mark) saw(mark, call, fd, name); \
    return result

static int cut_to(int fd, off_t size) { ON_FILE("ftruncate", WRITES, 'w', (int)syscall(SYS_ftruncate, fd, size)); }
int ftruncate(int fd, off_t size) { return cut_to(fd, size); }
int ftruncate64(int fd, off64_t size) { return cut_to(fd, size); }
static int allotted(int fd, int mode, off_t at, off_t size)
{
    ON_FILE("fallocate", WRITES, 'w', (int)syscall(SYS_fallocate, fd, mode, at, size));
}
int fallocate(int fd, int mode, off_t at, off_t size) { return allotted(fd, mode, at, size); }
int fallocate64(int fd, int mode, off64_t at, off64_t size) { return allotted(fd, mode, at, size); }
int posix_fallocate(int fd, off_t at, off_t size) { return allotted(fd, 0, at, size) ? errno : 0; }
int posix_fallocate64(int fd, off64_t at, off64_t size) { return allotted(fd, 0, at, size) ? errno : 0; }
int fsync(int fd) { ON_FILE("fsync", SYNCS, 's', (int)syscall(SYS_fsync, fd)); }
int fdatasync(int fd) { ON_FILE("fdatasync", SYNCS, 's', (int)syscall(SYS_fdatasync, fd)); }
int fchmod(int fd, mode_t mode) { ON_FILE("chmod", MARKS, 0, (int)syscall(SYS_fchmod, fd, mode)); }

/* ------------------------------------------------------------------------------------------------------------ names */
#define ON_PATH(call, does, at, path, whole) \
    char found[PATH_MAX]; \
    const char *name = armed ? of_path(at, path, found) : NULL; \
    if (!name) return whole; \
    int error = met(call, does, name); \
    if (error > 0) return errno = error, -1; \
    return whole

static int renamed(int from_at, const char *from, int at, const char *path, unsigned flags)
{
    char source[PATH_MAX];
    if (armed && !of_path(at, path, source)) { /* out of the folder: it is taken away */
        ON_PATH("rename", NAMES, from_at, from, (int)syscall(SYS_renameat2, from_at, from, at, path, flags));
    }
    ON_PATH("rename", MAKES | NAMES, at, path, (int)syscall(SYS_renameat2, from_at, from, at, path, flags));
}
int rename(const char *from, const char *path) { return renamed(AT_FDCWD, from, AT_FDCWD, path, 0); }
int renameat(int from_at, const char *from, int at, const char *path) { return renamed(from_at, from, at, path, 0); }
int renameat2(int from_at, const char *from, int at, const char *path, unsigned flags)
{
    return renamed(from_at, from, at, path, flags);
}
/* To take away what is not there changes nothing, whatever fails. */
static int taken(int at, const char *path, int flags)
{
    struct stat old;
    if (fstatat(at, path, &old, AT_SYMLINK_NOFOLLOW)) return (int)syscall(SYS_unlinkat, at, path, flags);
    ON_PATH(flags & AT_REMOVEDIR ? "rmdir" : "unlink", NAMES, at, path, (int)syscall(SYS_unlinkat, at, path, flags));
}
int unlink(const char *path) { return taken(AT_FDCWD, path, 0); }
int unlinkat(int at, const char *path, int flags) { return taken(at, path, flags); }
int rmdir(const char *path) { return taken(AT_FDCWD, path, AT_REMOVEDIR); }
static int folder_made(int at, const char *path, mode_t mode)
{
    struct stat old;
    if (!fstatat(at, path, &old, AT_SYMLINK_NOFOLLOW)) return (int)syscall(SYS_mkdirat, at, path, mode);
    ON_PATH("mkdir", MAKES, at, path, (int)syscall(SYS_mkdirat, at, path, mode));
}
int mkdir(const char *path, mode_t mode) { return folder_made(AT_FDCWD, path, mode); }
int mkdirat(int at, const char *path, mode_t mode) { return folder_made(at, path, mode); }
int link(const char *from, const char *path)
{
    ON_PATH("link", MAKES | NAMES, AT_FDCWD, path, (int)syscall(SYS_linkat, AT_FDCWD, from, AT_FDCWD, path, 0));
}
int linkat(int from_at, const char *from, int at, const char *path, int flags)
{
    ON_PATH("link", MAKES | NAMES, at, path, (int)syscall(SYS_linkat, from_at, from, at, path, flags));
}
int symlink(const char *to, const char *path)
{
    ON_PATH("symlink", MAKES | NAMES, AT_FDCWD, path, (int)syscall(SYS_symlinkat, to, AT_FDCWD, path));
}
int symlinkat(const char *to, int at, const char *path)
{
    ON_PATH("symlink", MAKES | NAMES, at, path, (int)syscall(SYS_symlinkat, to, at, path));
}
int chmod(const char *path, mode_t mode)
{
    ON_PATH("chmod", MARKS, AT_FDCWD, path, (int)syscall(SYS_fchmodat, AT_FDCWD, path, mode));
}
int utimensat(int at, const char *path, const struct timespec times[2], int flags)
{
    ON_PATH("utime", MARKS, at, path, (int)syscall(SYS_utimensat, at, path, times, flags));
}
