/* What the programs of this directory share: the leaf word of a quadrant, the part files of a leaf-set directory, and
 * errors.
 *
 * A leaf word is morton57 << 7 | level << 2 | side. The coordinates of p4est are in units of level 19, like those of
 * leaf words, but p4est splits no octant beyond level 18. p4est knows no sides, so side bits are 0.
 */
#ifndef LEAVES_H
#define LEAVES_H

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <p8est_bits.h>
#include <p8est_extended.h>

#if P8EST_MAXLEVEL != 19
#error "leaf words have coordinates in units of level 19, and p4est must have the same"
#endif

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

/* The word of a leaf. */
static uint64_t word_of(const p8est_quadrant_t *leaf)
{
    uint64_t morton = 0;
    for (int bit = 0; bit < 19; ++bit)
        morton |= (uint64_t) (leaf->x >> bit & 1) << (3 * bit) | (uint64_t) (leaf->y >> bit & 1) << (3 * bit + 1) |
                  (uint64_t) (leaf->z >> bit & 1) << (3 * bit + 2);
    return morton << 7 | (uint64_t) leaf->level << 2;
}

/* Writes the words of quadrants as a part of a leaf-set directory, which must exist. */
static void write_part(const char *directory, int part, const sc_array_t *quadrants)
{
    char path[4096], header[128];
    if (snprintf(path, sizeof path, "%s/leaves-%05d.npy", directory, part) >= (int) sizeof path)
        fail(EXIT_WRITE, "the path of the directory %s is too long", directory);
    FILE *file = fopen(path, "wb");
    if (file == NULL)
        fail(EXIT_WRITE, "%s cannot be written", path);
    size_t count = quadrants->elem_count;
    int used = snprintf(header, sizeof header,
                        "{'descr': '<u8', 'fortran_order': False, 'shape': (%zu,), }", count);
    /* The first ten bytes and the header have 128 bytes together, of which the last is a line feed. */
    memset(header + used, ' ', 118 - (size_t) used);
    header[117] = '\n';
    fwrite("\x93NUMPY\x01\x00\x76\x00", 1, 10, file);
    fwrite(header, 1, 118, file);
    for (size_t i = 0; i < count; ++i) {
        uint64_t word = word_of(p8est_quadrant_array_index((sc_array_t *) quadrants, i));
        fwrite(&word, sizeof word, 1, file);
    }
    if (ferror(file) | fclose(file))
        fail(EXIT_WRITE, "%s could not be written completely", path);
}

#endif
