/* Messages and exit codes of the programs of this directory. */
#ifndef FAIL_H
#define FAIL_H

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

enum { EXIT_WRITE = 4 };

/* The name of the program, for messages. */
extern const char *const program_name;

/* Prints a message and exits. */
static _Noreturn void fail(int code, const char *format, ...)
{
    va_list values;
    va_start(values, format);
    fprintf(stderr, "%s: ", program_name);
    vfprintf(stderr, format, values);
    fputc('\n', stderr);
    va_end(values);
    exit(code);
}

#endif
