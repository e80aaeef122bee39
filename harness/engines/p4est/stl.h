/* Reads the STL files that the harness writes: binary, or ASCII for small bodies. */
#ifndef STL_H
#define STL_H

#include <inttypes.h>
#include <stdbool.h>
#include <string.h>

#include "fail.h"

enum { EXIT_INPUT = 2 };

/* Facet i has the vertices 3 i to 3 i + 2. */
struct facets {
    double (*vertices)[3];
    size_t count;
};

/* The bytes of a file, with a terminating zero. */
static char *read_file(const char *path, size_t *length)
{
    FILE *file = fopen(path, "rb");
    if (file == NULL)
        fail(EXIT_INPUT, "%s cannot be opened", path);
    fseek(file, 0, SEEK_END);
    long size = ftell(file);
    rewind(file);
    char *bytes = size < 0 ? NULL : malloc((size_t) size + 1);
    if (bytes == NULL || fread(bytes, 1, (size_t) size, file) != (size_t) size)
        fail(EXIT_INPUT, "%s cannot be read", path);
    fclose(file);
    bytes[size] = '\0';
    *length = (size_t) size;
    return bytes;
}

static struct facets read_stl(const char *path)
{
    size_t length;
    char *bytes = read_file(path, &length);
    uint32_t count = 0;
    if (length >= 84)
        memcpy(&count, bytes + 80, sizeof count);
    bool binary = length == 84 + 50 * (size_t) count;
    /* A vertex takes at least 16 characters as text. */
    struct facets facets = {malloc((binary ? 3 * (size_t) count : length / 16) * 3 * sizeof(double) + 1), 0};
    if (facets.vertices == NULL)
        fail(EXIT_INPUT, "not enough memory for the facets of %s", path);
    size_t vertices = 0;
    if (binary)
        for (; vertices < 3 * (size_t) count; ++vertices) {
            float values[3];
            memcpy(values, bytes + 84 + 50 * (vertices / 3) + 12 + 12 * (vertices % 3), sizeof values);
            for (int a = 0; a < 3; ++a)
                facets.vertices[vertices][a] = values[a];
        }
    else
        for (char *at = bytes; (at = strstr(at, "vertex")) != NULL; ++vertices) {
            at += strlen("vertex");
            /* The nearest single-precision number, as a binary file would have it. */
            for (int a = 0; a < 3; ++a)
                facets.vertices[vertices][a] = strtof(at, &at);
        }
    free(bytes);
    facets.count = vertices / 3;
    return facets;
}

#endif
