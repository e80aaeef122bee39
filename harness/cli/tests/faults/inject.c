/* Runs a program and injects a fault into its N-th system call of some classes on files below a directory.
 *
 *   inject CLASSES ACTION N DIR LOG PROGRAM [ARGUMENT...]
 *
 *   CLASSES  of open, read, write, sync, rename, truncate, mkdir, list, with commas
 *   ACTION   count; an error number that the call gives; short: it transfers half of the bytes; or SIG and the number of a signal
 *   N        the call, from 1; N+ for this and all later ones
 *   LOG      gets a line for each call: class, path, the first word that is written, and a ! if the fault was injected
 *
 * The kernel reports the calls (seccomp with user notification), so calls that bypass the C library count as well, and so do those of all
 * threads and descendants. With INJECT_RANK only the rank of an MPI job with this number is affected. It ends as the program does, or with exit code 99 if faults
 * cannot be injected here.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

enum { UNAVAILABLE = 99, CALLS_MAX = 40, PATH = 4096, CHUNK = 1 << 16 };
/* Where a call has its file: a descriptor; a path relative to the descriptor before it, or to the working directory. */
enum where { FD, PATH_AT, PATH_HERE };
static const struct call { const char *class; int number; enum where where; int argument; } calls[] = {
    {"open", SYS_openat, PATH_AT, 1}, {"read", SYS_read, FD, 0}, {"read", SYS_pread64, FD, 0}, {"read", SYS_readv, FD, 0},
    {"write", SYS_write, FD, 0}, {"write", SYS_pwrite64, FD, 0}, {"write", SYS_writev, FD, 0}, {"sync", SYS_fsync, FD, 0},
    {"sync", SYS_fdatasync, FD, 0}, {"rename", SYS_renameat, PATH_AT, 3}, {"rename", SYS_renameat2, PATH_AT, 3},
    {"rename", SYS_linkat, PATH_AT, 3}, {"truncate", SYS_ftruncate, FD, 0}, {"mkdir", SYS_mkdirat, PATH_AT, 1},
    {"list", SYS_getdents64, FD, 0},
#ifdef SYS_open
    {"open", SYS_open, PATH_HERE, 0}, {"rename", SYS_rename, PATH_HERE, 1}, {"rename", SYS_link, PATH_HERE, 1},
    {"mkdir", SYS_mkdir, PATH_HERE, 0},
#endif
};
enum { CALLS = sizeof calls / sizeof *calls };

static const struct call *find(int number) {
    for (int i = 0; i < CALLS; i++)
        if (calls[i].number == number) return &calls[i];
    return NULL;
}

/* Makes the calls of the classes wait for this program. Returns the descriptor that reports them. */
static int filter(const char *classes) {
    struct sock_filter code[2 * CALLS_MAX + 3] = {BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, nr))};
    unsigned short n = 1;
    for (int i = 0; i < CALLS; i++) {
        if (!strstr(classes, calls[i].class)) continue;
        code[n++] = (struct sock_filter)BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, (unsigned)calls[i].number, 0, 1);
        code[n++] = (struct sock_filter)BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_USER_NOTIF);
    }
    code[n++] = (struct sock_filter)BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW);
    struct sock_fprog program = {n, code};
    prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
    return (int)syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, SECCOMP_FILTER_FLAG_NEW_LISTENER, &program);
}

static void read_link(char *to, pid_t pid, const char *what, int fd) {
    char link[64];
    snprintf(link, sizeof link, fd < 0 ? "/proc/%d/%s" : "/proc/%d/%s/%d", pid, what, fd);
    ssize_t n = readlink(link, to, PATH - 1);
    to[n < 0 ? 0 : n] = 0;
}

static ssize_t memory(pid_t pid, void *bytes, size_t length, unsigned long long at, int is_write) {
    char name[64];
    snprintf(name, sizeof name, "/proc/%d/mem", pid);
    int fd = open(name, is_write ? O_WRONLY : O_RDONLY);
    ssize_t n = is_write ? pwrite(fd, bytes, length, (off_t)at) : pread(fd, bytes, length, (off_t)at);
    close(fd);
    return n;
}

/* The absolute path of the file of a call. */
static void locate(char *path, const struct call *call, const struct seccomp_notif *n) {
    int at = call->where == PATH_AT ? (int)n->data.args[call->argument - 1] : AT_FDCWD;
    if (call->where == FD) return read_link(path, (pid_t)n->pid, "fd", (int)n->data.args[0]);
    char given[PATH] = "";
    unsigned long long from = n->data.args[call->argument];
    /* A string may end just before memory that cannot be read. */
    for (size_t i = 0; i < PATH - 1 && memory((pid_t)n->pid, given + i, 1, from + i, 0) == 1 && given[i]; i++) given[i + 1] = 0;
    if (given[0] == '/') { strcpy(path, given); return; }
    if (at == AT_FDCWD) read_link(path, (pid_t)n->pid, "cwd", -1); else read_link(path, (pid_t)n->pid, "fd", at);
    strncat(path, "/", PATH - 1 - strlen(path));
    strncat(path, given, PATH - 1 - strlen(path));
}

/* The process of a thread. */
static pid_t process_of(pid_t thread) {
    char name[64], line[256];
    pid_t process = thread;
    snprintf(name, sizeof name, "/proc/%d/status", thread);
    FILE *file = fopen(name, "re");
    while (file && fgets(line, sizeof line, file))
        if (sscanf(line, "Tgid: %d", &process) == 1) break;
    if (file) fclose(file);
    return process;
}

/* Transfers half of the bytes of a call, with a copy of its descriptor. Returns whether that was possible. */
static int transfer(const struct seccomp_notif *n, struct seccomp_notif_resp *answer) {
    static char bytes[CHUNK];
    size_t length = n->data.args[2] / 2 < CHUNK ? n->data.args[2] / 2 : CHUNK;
    int nr = n->data.nr;
    if (length == 0 || (nr != SYS_read && nr != SYS_pread64 && nr != SYS_write && nr != SYS_pwrite64)) return 0;
    int process = (int)syscall(SYS_pidfd_open, process_of((pid_t)n->pid), 0);
    int fd = (int)syscall(SYS_pidfd_getfd, process, (int)n->data.args[0], 0);
    close(process);
    if (fd < 0) return 0;
    off_t at = (off_t)n->data.args[3];
    ssize_t done;
    if (nr == SYS_read || nr == SYS_pread64) {
        done = nr == SYS_read ? read(fd, bytes, length) : pread(fd, bytes, length, at);
        if (done > 0) memory((pid_t)n->pid, bytes, (size_t)done, n->data.args[1], 1);
    } else {
        memory((pid_t)n->pid, bytes, length, n->data.args[1], 0);
        done = nr == SYS_write ? write(fd, bytes, length) : pwrite(fd, bytes, length, at);
    }
    answer->val = done;
    answer->error = done < 0 ? -errno : 0;
    close(fd);
    return 1;
}

int main(int argc, char **argv) {
    if (argc < 7) return UNAVAILABLE;
    const char *classes = argv[1], *action = argv[2], *dir = argv[4], *chosen = getenv("INJECT_RANK");
    const char *rank = getenv("OMPI_COMM_WORLD_RANK");
    if (chosen && (!rank || strcmp(chosen, rank))) execvp(argv[6], argv + 6);
    long nth = strtol(argv[3], NULL, 10), count = 0;
    FILE *log = fopen(argv[5], "we");
    struct sigaction ignored = {.sa_handler = SIG_IGN}, before[3];
    const int forwarded[3] = {SIGINT, SIGTERM, SIGHUP};
    for (int i = 0; i < 3; i++) sigaction(forwarded[i], &ignored, &before[i]);
    /* The child shares the table of descriptors until it executes the program, and its next free descriptor is known. */
    int listener = dup(0);
    close(listener);
    pid_t child = (pid_t)syscall(SYS_clone, CLONE_FILES | CLONE_VFORK | SIGCHLD, 0, 0, 0, 0);
    if (child == 0) {
        for (int i = 0; i < 3; i++) sigaction(forwarded[i], &before[i], NULL);
        if (filter(classes) != listener) _exit(UNAVAILABLE);
        execvp(argv[6], argv + 6);
        _exit(UNAVAILABLE);
    }
    int status;
    while (waitpid(child, &status, WNOHANG) == 0) {
        struct pollfd ready = {listener, POLLIN, 0};
        struct seccomp_notif n = {0};
        if (poll(&ready, 1, 10) <= 0 || !(ready.revents & POLLIN) || ioctl(listener, SECCOMP_IOCTL_NOTIF_RECV, &n)) continue;
        const struct call *call = find(n.data.nr);
        struct seccomp_notif_resp answer = {.id = n.id, .flags = SECCOMP_USER_NOTIF_FLAG_CONTINUE};
        char path[PATH] = "";
        locate(path, call, &n);
        if (!strncmp(path, dir, strlen(dir)) && path[strlen(dir)] == '/') {
            count++;
            int is_hit = nth > 0 && (count == nth || (count > nth && strchr(argv[3], '+')));
            char word[24] = "";
            if (!strcmp(call->class, "write")) memory((pid_t)n.pid, word, sizeof word - 1, n.data.args[1], 0);
            word[strspn(word, "abcdefghijklmnopqrstuvwxyz")] = 0;
            fprintf(log, "%s %s %s%s\n", call->class, path, word, is_hit ? " !" : "");
            fflush(log);
            if (is_hit && !strncmp(action, "SIG", 3)) {
                /* A user interrupts the program, whichever of its processes calls. */
                kill(atoi(action + 3) == SIGKILL ? (pid_t)n.pid : child, atoi(action + 3));
            } else if (is_hit && !strcmp(action, "short")) {
                if (transfer(&n, &answer)) answer.flags = 0;
            } else if (is_hit) {
                answer.flags = 0;
                answer.error = -atoi(action);
            }
        }
        ioctl(listener, SECCOMP_IOCTL_NOTIF_SEND, &answer);
    }
    if (WIFEXITED(status)) return WEXITSTATUS(status);
    signal(WTERMSIG(status), SIG_DFL);
    kill(getpid(), WTERMSIG(status));
    return UNAVAILABLE;
}
