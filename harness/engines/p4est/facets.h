/* Facets of a binary STL file, which is what the harness writes; and whether a cube and any of many facets share a point. */
#ifndef FACETS_H
#define FACETS_H

#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "fail.h"

enum { EXIT_INPUT = 2 };

/* Facet i has the vertices 3 i to 3 i + 2. */
struct facets {
    double (*vertices)[3];
    size_t count;
};

/* The bytes of a file. */
static char *read_file(const char *path, size_t *length)
{
    FILE *file = fopen(path, "rb");
    if (file == NULL)
        fail(EXIT_INPUT, "%s cannot be opened", path);
    fseek(file, 0, SEEK_END);
    long size = ftell(file);
    rewind(file);
    char *bytes = size < 0 ? NULL : malloc((size_t) size);
    if (bytes == NULL || fread(bytes, 1, (size_t) size, file) != (size_t) size)
        fail(EXIT_INPUT, "%s cannot be read", path);
    fclose(file);
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
    if (length != 84 + 50 * (size_t) count)
        fail(EXIT_INPUT, "%s is no binary STL file", path);
    struct facets facets = {malloc((size_t) count * 9 * sizeof(double) + 1), count};
    if (facets.vertices == NULL)
        fail(EXIT_INPUT, "not enough memory for the facets of %s", path);
    for (size_t i = 0; i < 3 * (size_t) count; ++i) {
        float values[3];
        memcpy(values, bytes + 84 + 50 * (i / 3) + 12 + 12 * (i % 3), sizeof values);
        for (int a = 0; a < 3; ++a)
            facets.vertices[i][a] = values[a];
    }
    free(bytes);
    return facets;
}

/* Vertices are rounded to this number of units along an edge of the root, which makes most tests below exact. */
#define UNITS (1 << 27)
/* Facets as a binary tree of bounding boxes: node i has the children 2 i + 1 and 2 i + 2, which halve its facets. */
struct tree {
    struct facets facets;
    double (*bounds)[2][3];
};

/* Facets of a node without children. */
#define FACETS_LEAF 4

/* Orders facets along the Morton curve by their first vertices, so that neighbours in the list are neighbours in space. */
static int by_curve(const void *a, const void *b)
{
    const double *left = a, *right = b;
    uint32_t most = 0;
    int axis = 0;
    for (int i = 0; i < 3; ++i) {
        uint32_t differing = (uint32_t) (left[i] + UNITS) ^ (uint32_t) (right[i] + UNITS);
        /* Whether the highest bit that differs is higher than on the axes before. */
        if (most < differing && most < (most ^ differing)) {
            most = differing;
            axis = i;
        }
    }
    return (left[axis] > right[axis]) - (left[axis] < right[axis]);
}

/* The bounding boxes of a node and all nodes below it. */
static void bound(struct tree *s, size_t node, size_t first, size_t last)
{
    double(*box)[3] = s->bounds[node];
    for (int a = 0; a < 3; ++a) {
        box[0][a] = DBL_MAX;
        box[1][a] = -DBL_MAX;
        for (size_t i = 3 * first; i < 3 * last; ++i) {
            box[0][a] = fmin(box[0][a], s->facets.vertices[i][a]);
            box[1][a] = fmax(box[1][a], s->facets.vertices[i][a]);
        }
    }
    if (last - first > FACETS_LEAF) {
        bound(s, 2 * node + 1, first, (first + last) / 2);
        bound(s, 2 * node + 2, (first + last) / 2, last);
    }
}

/* The tree of facets whose vertices are converted from the user's units. */
static struct tree tree_of(struct facets facets, const double origin[3], double edge)
{
    struct tree s = {.facets = facets};
    for (size_t i = 0; i < 3 * facets.count; ++i)
        for (int a = 0; a < 3; ++a)
            facets.vertices[i][a] = nearbyint((facets.vertices[i][a] - origin[a]) * (UNITS / edge));
    qsort(facets.vertices, facets.count, 3 * sizeof *facets.vertices, by_curve);
    size_t nodes = 1;
    while (nodes < 2 * facets.count)
        nodes *= 2;
    if ((s.bounds = malloc(nodes * sizeof *s.bounds)) == NULL)
        fail(EXIT_INPUT, "not enough memory for %zu facets", facets.count);
    bound(&s, 0, 0, facets.count);
    return s;
}

/* Whether a facet and a closed cube share a point: separating axes. */
static bool meets(const double facet[3][3], const double centre[3], double half)
{
    double v[3][3], e[3][3];
    for (int a = 0; a < 3; ++a) {
        for (int i = 0; i < 3; ++i) {
            v[i][a] = facet[i][a] - centre[a];
            e[i][a] = facet[(i + 1) % 3][a] - facet[i][a];
        }
        if (fmin(v[0][a], fmin(v[1][a], v[2][a])) > half || fmax(v[0][a], fmax(v[1][a], v[2][a])) < -half)
            return false;
    }
    for (int i = 0; i < 3; ++i)
        for (int a = 0; a < 3; ++a) {
            int b = (a + 1) % 3, c = (a + 2) % 3;
            double low = DBL_MAX, high = -DBL_MAX, radius = half * (fabs(e[i][b]) + fabs(e[i][c]));
            for (int j = 0; j < 3; ++j) {
                double along = v[j][c] * e[i][b] - v[j][b] * e[i][c];
                low = fmin(low, along);
                high = fmax(high, along);
            }
            if (low > radius || high < -radius)
                return false;
        }
    double distance = 0, radius = 0;
    for (int a = 0; a < 3; ++a) {
        double normal = e[0][(a + 1) % 3] * e[1][(a + 2) % 3] - e[0][(a + 2) % 3] * e[1][(a + 1) % 3];
        distance += normal * v[0][a];
        radius += half * fabs(normal);
    }
    return fabs(distance) <= radius;
}

/* Whether any facet of a node and a closed cube share a point. */
static bool any_meets(const struct tree *s, size_t node, size_t first, size_t last, const double centre[3], double half)
{
    const double(*box)[3] = (const double(*)[3]) s->bounds[node];
    bool within = true;
    for (int a = 0; a < 3; ++a) {
        if (box[0][a] > centre[a] + half || box[1][a] < centre[a] - half)
            return false;
        within &= box[0][a] >= centre[a] - half && box[1][a] <= centre[a] + half;
    }
    if (within)
        return true;
    if (last - first > FACETS_LEAF)
        return any_meets(s, 2 * node + 1, first, (first + last) / 2, centre, half) ||
               any_meets(s, 2 * node + 2, (first + last) / 2, last, centre, half);
    for (size_t i = first; i < last; ++i)
        if (meets((const double(*)[3]) s->facets.vertices + 3 * i, centre, half))
            return true;
    return false;
}

#endif
