/*
 * A command, stopped before each of its system calls on files below one folder: listed, killed, made to fail, or cut off as by a
 * loss of power. x86-64 Linux; the calls are caught by a seccomp filter, so that no library between the program and the kernel
 * can hide one.
 *
 *     tracer LOG FOLDER list changes|all        -- COMMAND...    writes the calls to LOG and lets them pass
 *     tracer LOG FOLDER kill N                  -- COMMAND...    kills the command before its N-th change (from 1)
 *     tracer LOG FOLDER cut N keep|undo         -- COMMAND...    the same; then what was not synced is lost, also where the
 *                                                               command ended by itself before its N-th change
 *     tracer LOG FOLDER fail N CLASS ERRNO|short -- COMMAND...   the first call of that class from the N-th call of all on fails,
 *                                                               or moves half of its bytes
 *     tracer LOG FOLDER fail N CLASS ERRNO on   -- COMMAND...    and so does every later one of that class
 *
 * Exit: the command's own; 128 + the signal that it died of; 200 killed here; 201 this program cannot trace here.
 *
 * What a cut loses. Data: a file keeps the length that it had at its last fsync (one that the command never synced: the length
 * before its first write). Names: with "keep" all renames, creations and removals survive, the worst of a file system that orders
 * nothing; with "undo" those are undone that came after the last fsync of the folder that holds the name. Bytes written over
 * synced ones, and shared maps, are not followed: the command is stopped with 201 where it writes at a place of its own choice.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <ftw.h>
#include <limits.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/ptrace.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/user.h>
#include <sys/wait.h>
#include <unistd.h>

enum { KILLED = 200, UNABLE = 201 };

/* Where a call's paths stand: a descriptor, a path, a folder's descriptor and a path, two of these. */
enum shape { FD, PATH, AT, PATHS, ATS, TARGET_PATH, TARGET_AT };

/* Changes first: the classes up to MKDIR change what a folder holds. */
enum class { CREATE, WRITE, SYNC, TRUNCATE, RENAME, LINK, UNLINK, MKDIR, OPEN, READ, LISTING, STAT, LOCK, CLOSE };
static const char *const CLASSES[] = {"create", "write", "sync", "truncate", "rename", "link", "unlink",
                                      "mkdir", "open", "read", "listing", "stat", "lock", "close"};

static const struct call {
    int number;
    const char *name;
    enum class class;
    enum shape shape;
} CALLS[] = {
    {SYS_open, "open", OPEN, PATH}, {SYS_openat, "openat", OPEN, AT}, {SYS_creat, "creat", CREATE, PATH},
    {SYS_openat2, "openat2", OPEN, AT},
    {SYS_write, "write", WRITE, FD}, {SYS_writev, "writev", WRITE, FD}, {SYS_pwrite64, "pwrite64", WRITE, FD},
    {SYS_pwritev, "pwritev", WRITE, FD}, {SYS_copy_file_range, "copy_file_range", WRITE, FD},
    {SYS_sendfile, "sendfile", WRITE, FD}, {SYS_fallocate, "fallocate", WRITE, FD},
    {SYS_fsync, "fsync", SYNC, FD}, {SYS_fdatasync, "fdatasync", SYNC, FD},
    {SYS_truncate, "truncate", TRUNCATE, PATH}, {SYS_ftruncate, "ftruncate", TRUNCATE, FD},
    {SYS_rename, "rename", RENAME, PATHS}, {SYS_renameat, "renameat", RENAME, ATS},
    {SYS_renameat2, "renameat2", RENAME, ATS},
    {SYS_link, "link", LINK, PATHS}, {SYS_linkat, "linkat", LINK, ATS},
    {SYS_symlink, "symlink", CREATE, TARGET_PATH}, {SYS_symlinkat, "symlinkat", CREATE, TARGET_AT},
    {SYS_unlink, "unlink", UNLINK, PATH}, {SYS_unlinkat, "unlinkat", UNLINK, AT}, {SYS_rmdir, "rmdir", UNLINK, PATH},
    {SYS_mkdir, "mkdir", MKDIR, PATH}, {SYS_mkdirat, "mkdirat", MKDIR, AT},
    {SYS_read, "read", READ, FD}, {SYS_pread64, "pread64", READ, FD}, {SYS_readv, "readv", READ, FD},
    {SYS_getdents64, "getdents64", LISTING, FD},
    {SYS_stat, "stat", STAT, PATH}, {SYS_lstat, "lstat", STAT, PATH}, {SYS_fstat, "fstat", STAT, FD},
    {SYS_newfstatat, "newfstatat", STAT, AT}, {SYS_statx, "statx", STAT, AT},
    {SYS_flock, "flock", LOCK, FD}, {SYS_close, "close", CLOSE, FD},
};
enum { COUNT = sizeof CALLS / sizeof *CALLS };

static const struct { const char *name; int number; } ERRORS[] = {
    {"EIO", EIO}, {"ENOSPC", ENOSPC}, {"EINTR", EINTR}, {"EMFILE", EMFILE},
    {"EROFS", EROFS}, {"EXDEV", EXDEV}, {"EACCES", EACCES}, {"EDQUOT", EDQUOT}, {"ESTALE", ESTALE},
};

static struct {
    FILE *log;
    const char *folder;
    enum { LIST, KILL, CUT, FAIL } action;
    int all, undo, half, on, error, failed;
    unsigned long at;
    const char *failing;
} asked;

static char shadow[PATH_MAX];
static pid_t group;

static void give_up(const char *format, ...) {
    va_list words;
    va_start(words, format);
    vfprintf(stderr, format, words);
    va_end(words);
    fputc('\n', stderr);
    if (group > 0)
        kill(-group, SIGKILL);
    exit(UNABLE);
}

/* ---- Paths of a call, as the kernel will take them ---- */

struct site {
    char path[PATH_MAX], other[PATH_MAX]; /* `other`: where a rename or link comes from. */
};

static void read_text(pid_t pid, unsigned long at, char *text) {
    char name[64];
    snprintf(name, sizeof name, "/proc/%d/mem", pid);
    int memory = open(name, O_RDONLY | O_CLOEXEC);
    ssize_t length = memory < 0 ? -1 : pread(memory, text, PATH_MAX - 1, (off_t)at);
    text[length < 0 ? 0 : length] = 0;
    close(memory);
}

static void read_link(char *path, pid_t pid, int descriptor) {
    char name[64];
    if (descriptor == AT_FDCWD)
        snprintf(name, sizeof name, "/proc/%d/cwd", pid);
    else
        snprintf(name, sizeof name, "/proc/%d/fd/%d", pid, descriptor);
    ssize_t length = readlink(name, path, PATH_MAX - 1);
    path[length < 0 ? 0 : length] = 0;
    char *deleted = strstr(path, " (deleted)");
    if (deleted)
        *deleted = 0;
}

/* Absolute, without "." and "..": what is traced has no links within the folder. */
static void resolve(char *out, pid_t pid, int descriptor, unsigned long at) {
    char text[PATH_MAX], joined[2 * PATH_MAX], *part, *rest = NULL;
    read_text(pid, at, text);
    joined[0] = 0;
    if (text[0] != '/')
        read_link(joined, pid, descriptor);
    strcat(strcat(joined, "/"), text);
    out[0] = 0;
    for (part = strtok_r(joined, "/", &rest); part; part = strtok_r(NULL, "/", &rest)) {
        char *last = strrchr(out, '/');
        if (!strcmp(part, ".."))
            *(last ? last : out) = 0;
        else if (strcmp(part, ".") && strlen(out) + strlen(part) + 2 < PATH_MAX)
            strcat(strcat(out, "/"), part);
    }
}

static void paths_of(struct site *site, pid_t pid, enum shape shape, const struct user_regs_struct *r) {
    site->other[0] = 0;
    switch (shape) {
    case FD: read_link(site->path, pid, (int)r->rdi); break;
    case PATH: resolve(site->path, pid, AT_FDCWD, r->rdi); break;
    case AT: resolve(site->path, pid, (int)r->rdi, r->rsi); break;
    case TARGET_PATH: resolve(site->path, pid, AT_FDCWD, r->rsi); break;
    case TARGET_AT: resolve(site->path, pid, (int)r->rsi, r->rdx); break;
    case PATHS:
        resolve(site->other, pid, AT_FDCWD, r->rdi);
        resolve(site->path, pid, AT_FDCWD, r->rsi);
        break;
    case ATS:
        resolve(site->other, pid, (int)r->rdi, r->rsi);
        resolve(site->path, pid, (int)r->rdx, r->r10);
        break;
    }
}

static int is_below(const char *path) {
    size_t length = strlen(asked.folder);
    return !strncmp(path, asked.folder, length) && (path[length] == '/' || !path[length]);
}

/* ---- What a cut must take back ---- */

/* A name that was made, moved or removed since the folder that holds it was synced. */
static struct step {
    enum { MADE, MOVED, REMOVED, FOLDER_REMOVED } kind;
    char *path, *other;
    ino_t inode; /* Of what was moved. */
    int kept;    /* What had the name before lies in the shadow folder under this number; 0: nothing had it. */
    int synced;
} *steps;
static size_t step_count;

/* Files that were written: how much of each is on disk. */
static struct data {
    dev_t device;
    ino_t inode;
    off_t synced;
} *written;
static size_t written_count;

static void *more(void *list, size_t count, size_t size) {
    void *longer = count & (count - 1) ? list : realloc(list, (count ? 2 * count : 1) * size);
    return longer ? longer : (give_up("no memory"), NULL);
}

static struct data *data_of(const struct stat *facts) {
    for (size_t k = 0; k < written_count; k++)
        if (written[k].inode == facts->st_ino && written[k].device == facts->st_dev)
            return &written[k];
    return NULL;
}

static struct data *data_or_new(const struct stat *facts) {
    struct data *data = data_of(facts);
    if (!data) {
        written = more(written, written_count, sizeof *written);
        data = &written[written_count++];
        *data = (struct data){facts->st_dev, facts->st_ino, facts->st_size};
    }
    return data;
}

static void shadow_path(char *path, int number) {
    snprintf(path, PATH_MAX, "%.4000s/%d", shadow, number);
}

static void keep_step(int kind, const char *path, const char *other) {
    struct stat facts;
    struct step step = {.kind = kind, .path = strdup(path), .other = strdup(other)};
    if (kind == MOVED && !lstat(other, &facts))
        step.inode = facts.st_ino;
    if (kind != MADE && kind != FOLDER_REMOVED && !lstat(path, &facts)) {
        char aside[PATH_MAX];
        step.kept = (int)step_count + 1;
        shadow_path(aside, step.kept);
        if (link(path, aside))
            give_up("%s cannot be kept aside: %s", path, strerror(errno));
    }
    steps = more(steps, step_count, sizeof *steps);
    steps[step_count++] = step;
}

/* All names in a folder are on disk once it is synced. */
static void sync_folder(const char *folder) {
    size_t length = strlen(folder);
    for (size_t k = 0; k < step_count; k++) {
        const char *slash = strrchr(steps[k].path, '/');
        if ((size_t)(slash - steps[k].path) == length && !strncmp(steps[k].path, folder, length))
            steps[k].synced = 1;
    }
}

static void sync_at(pid_t pid, int descriptor, const char *path) {
    char name[64];
    struct stat facts;
    snprintf(name, sizeof name, "/proc/%d/fd/%d", pid, descriptor);
    if (stat(name, &facts))
        return;
    if (S_ISDIR(facts.st_mode))
        sync_folder(path);
    else
        data_or_new(&facts)->synced = facts.st_size;
}

static void before_write(pid_t pid, int descriptor) {
    char name[64];
    struct stat facts;
    snprintf(name, sizeof name, "/proc/%d/fd/%d", pid, descriptor);
    if (!stat(name, &facts))
        data_or_new(&facts);
}

/* Notes, before a change is made, what a cut would have to take back. A change that then fails leaves nothing to undo: see there. */
static void follow(const struct call *call, enum class class, const struct site *site, pid_t pid,
                   const struct user_regs_struct *r) {
    struct stat facts;
    int there = !lstat(site->path, &facts);
    switch (class) {
    case CREATE:
        if (!there)
            keep_step(MADE, site->path, "");
        else if (r->rdx & O_TRUNC)
            data_or_new(&facts)->synced = 0;
        break;
    case WRITE:
        if (call->number == SYS_pwrite64 || call->number == SYS_pwritev)
            give_up("%s writes to a place of its own choice: a cut cannot follow that", call->name);
        before_write(pid, (int)(call->number == SYS_copy_file_range ? r->rdx : r->rdi));
        break;
    case SYNC: sync_at(pid, (int)r->rdi, site->path); break;
    case TRUNCATE:
        if (there && data_or_new(&facts)->synced > (off_t)r->rsi)
            data_of(&facts)->synced = (off_t)r->rsi;
        break;
    case RENAME: keep_step(MOVED, site->path, site->other); break;
    case UNLINK: keep_step(there && S_ISDIR(facts.st_mode) ? FOLDER_REMOVED : REMOVED, site->path, ""); break;
    case LINK:
    case MKDIR:
        if (!there)
            keep_step(MADE, site->path, "");
        break;
    default: break;
    }
}

static int remove_one(const char *path, const struct stat *facts, int kind, struct FTW *place) {
    (void)facts, (void)kind, (void)place;
    return remove(path), 0;
}

static void undo(const struct step *step) {
    struct stat facts;
    char aside[PATH_MAX];
    shadow_path(aside, step->kept);
    switch (step->kind) {
    case MADE: nftw(step->path, remove_one, 16, FTW_DEPTH | FTW_PHYS); break;
    case MOVED:
        if (lstat(step->path, &facts) || facts.st_ino != step->inode)
            return; /* The rename had failed. */
        rename(step->path, step->other);
        /* fall through */
    case REMOVED:
        if (step->kept && link(aside, step->path) && errno != EEXIST)
            give_up("%s cannot be put back: %s", step->path, strerror(errno));
        break;
    case FOLDER_REMOVED: mkdir(step->path, 0777); break;
    }
}

static int drop_data(const char *path, const struct stat *facts, int kind, struct FTW *place) {
    (void)place;
    const struct data *data = kind == FTW_F ? data_of(facts) : NULL;
    if (data && data->synced < facts->st_size && truncate(path, data->synced))
        give_up("%s cannot be cut: %s", path, strerror(errno));
    return 0;
}

static void lose_power(void) {
    for (size_t k = step_count; asked.undo && k > 0; k--)
        if (!steps[k - 1].synced)
            undo(&steps[k - 1]);
    nftw(asked.folder, drop_data, 16, FTW_PHYS);
    nftw(shadow, remove_one, 16, FTW_DEPTH | FTW_PHYS);
}

/* ---- A call ---- */

static enum class class_of(const struct call *call, const struct user_regs_struct *r) {
    unsigned long flags = call->number == SYS_open ? r->rsi : r->rdx;
    return call->class == OPEN && call->number != SYS_openat2 && flags & (O_CREAT | O_TRUNC) ? CREATE : call->class;
}

static void end_here(void) {
    kill(-group, SIGKILL);
    while (waitpid(-1, NULL, __WALL) > 0 || errno == EINTR) {
    }
    if (asked.action == CUT)
        lose_power();
    fclose(asked.log);
    exit(KILLED);
}

static void fail(pid_t pid, struct user_regs_struct *r) {
    if (asked.half) {
        r->rdx = r->rdx > 1 ? r->rdx / 2 : r->rdx;
    } else {
        r->orig_rax = -1UL;
        r->rax = (unsigned long)-asked.error;
    }
    if (ptrace(PTRACE_SETREGS, pid, NULL, r))
        give_up("the call cannot be changed: %s", strerror(errno));
}

static void stopped_at_call(pid_t pid) {
    static unsigned long count;
    struct user_regs_struct r;
    struct site site;
    const struct call *call = CALLS;
    if (ptrace(PTRACE_GETREGS, pid, NULL, &r))
        return; /* It has just died. */
    while (call < CALLS + COUNT && call->number != (int)r.orig_rax)
        call++;
    if (call == CALLS + COUNT)
        return;
    enum class class = class_of(call, &r);
    if (class > MKDIR && !asked.all)
        return;
    paths_of(&site, pid, call->number == SYS_copy_file_range ? FD : call->shape, &r);
    if (!is_below(site.path))
        return;
    count++;
    const char *below = site.path + strlen(asked.folder), *other = site.other;
    fprintf(asked.log, "%lu\t%s\t%s\t%s\t%s\n", count, call->name, CLASSES[class], below,
            is_below(other) ? other + strlen(asked.folder) : other);
    if (asked.action == FAIL) {
        if (count >= asked.at && !strcmp(CLASSES[class], asked.failing) && (asked.on || !asked.failed)) {
            asked.failed = 1;
            fprintf(asked.log, "failed\t%lu\t\t\t\n", count);
            fail(pid, &r);
        }
    } else if ((asked.action == KILL || asked.action == CUT) && count == asked.at) {
        end_here();
    } else if (asked.action == CUT) {
        follow(call, class, &site, pid, &r);
    }
}

/* ---- The command under the filter ---- */

static void filter_calls(void) {
    struct sock_filter program[COUNT + 6];
    int at = 0;
    program[at++] = (struct sock_filter)BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, arch));
    program[at++] = (struct sock_filter)BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, AUDIT_ARCH_X86_64, 1, 0);
    program[at++] = (struct sock_filter)BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_KILL_PROCESS);
    program[at++] = (struct sock_filter)BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, nr));
    int first = at, chosen = 0;
    for (int k = 0; k < COUNT; k++)
        if (asked.all || CALLS[k].class <= OPEN)
            program[at++] = (struct sock_filter)BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, (unsigned)CALLS[k].number, 0, 0), chosen++;
    for (int k = 0; k < chosen; k++)
        program[first + k].jt = (unsigned char)(chosen - k); /* To the last line. */
    program[at++] = (struct sock_filter)BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW);
    program[at++] = (struct sock_filter)BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_TRACE);
    struct sock_fprog whole = {(unsigned short)at, program};
    if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) || prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &whole))
        give_up("no seccomp here: %s", strerror(errno));
}

static pid_t start(char **command) {
    int ready[2];
    char byte = 0;
    if (pipe2(ready, O_CLOEXEC))
        give_up("no pipe: %s", strerror(errno));
    pid_t child = fork();
    if (child < 0)
        give_up("no process: %s", strerror(errno));
    if (child == 0) {
        setpgid(0, 0);
        close(ready[1]);
        if (read(ready[0], &byte, 1) != 1)
            _exit(UNABLE);
        filter_calls();
        execvp(command[0], command);
        give_up("%s cannot be started: %s", command[0], strerror(errno));
    }
    setpgid(child, child);
    group = child;
    long options = PTRACE_O_TRACESECCOMP | PTRACE_O_TRACECLONE | PTRACE_O_TRACEFORK | PTRACE_O_TRACEVFORK |
                   PTRACE_O_TRACEEXEC | PTRACE_O_EXITKILL;
    if (ptrace(PTRACE_SEIZE, child, NULL, options))
        give_up("no ptrace here: %s", strerror(errno));
    if (write(ready[1], &byte, 1) != 1)
        give_up("the command is gone");
    close(ready[0]);
    close(ready[1]);
    return child;
}

static int follow_to_the_end(pid_t first) {
    int status, code = UNABLE;
    for (;;) {
        pid_t pid = waitpid(-1, &status, __WALL);
        if (pid < 0 && errno == EINTR)
            continue;
        if (pid < 0)
            return code;
        if (WIFSTOPPED(status)) {
            int event = status >> 16, signal = WSTOPSIG(status);
            if (event == PTRACE_EVENT_SECCOMP)
                stopped_at_call(pid);
            /* A signal goes on to the command; what ptrace itself tells by stopping does not. */
            ptrace(PTRACE_CONT, pid, NULL, (long)(event ? 0 : signal));
        } else if (pid == first) {
            code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
        }
    }
}

static void read_arguments(int count, char **words) {
    int at = 1;
    if (count < 7)
        give_up("tracer LOG FOLDER list|kill|cut|fail ... -- COMMAND...");
    asked.log = fopen(words[at++], "we");
    asked.folder = words[at++];
    const char *action = words[at++];
    asked.action = !strcmp(action, "list") ? LIST : !strcmp(action, "kill") ? KILL : !strcmp(action, "cut") ? CUT : FAIL;
    const char *first = words[at++], *second = words[at];
    asked.at = strtoul(first, NULL, 10);
    if (asked.action == FAIL) {
        asked.failing = second;
        second = words[++at];
    }
    asked.all = asked.action == FAIL || !strcmp(first, "all");
    asked.undo = !strcmp(second, "undo");
    asked.half = !strcmp(second, "short");
    asked.on = words[at + 1] && !strcmp(words[at + 1], "on");
    for (size_t k = 0; k < sizeof ERRORS / sizeof *ERRORS; k++)
        asked.error = strcmp(second, ERRORS[k].name) ? asked.error : ERRORS[k].number;
    if (!asked.log || (asked.action == FAIL && !asked.half && !asked.error))
        give_up("no such log or no such error: %s", second);
    snprintf(shadow, sizeof shadow, "%.4000s.shadow", asked.folder);
    if (asked.action == CUT && mkdir(shadow, 0700))
        give_up("%s: %s", shadow, strerror(errno));
}

int main(int count, char **words) {
    read_arguments(count, words);
    int at = 1;
    while (words[at] && strcmp(words[at], "--"))
        at++;
    if (!words[at] || !words[at + 1])
        give_up("no command behind --");
    int code = follow_to_the_end(start(words + at + 1));
    fclose(asked.log);
    if (asked.action == CUT)
        lose_power();
    nftw(shadow, remove_one, 16, FTW_DEPTH | FTW_PHYS);
    return code;
}
