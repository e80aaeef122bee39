/* Balances a base tree with p4est, as an independent test of the balance of this workspace.
 *
 *   p4est-balance TREE OUT
 *
 * Reads the leaves of the leaf-set directory TREE (all parts, in any order), builds a forest of one unit
 * cube with exactly these leaves, balances it over faces, edges and corners, and writes the resulting
 * leaves to OUT/leaves-00000.npy, sorted, with side bits 0. The directory OUT must exist.
 *
 * Exit codes: 0 success, 2 the tree cannot be read or is not complete, 3 it has leaves of level 19, 4 the
 * result could not be written.
 */
#include <dirent.h>
#include <inttypes.h>
#include <string.h>

#include <p8est_bits.h>
#include <p8est_build.h>
#include <p8est_extended.h>

#include "fail.h"

/* A leaf word is morton57 << 7 | level << 2 | side. The coordinates of p4est are in units of level 19, like those of
 * leaf words, but p4est splits no octant beyond level 18. p4est knows no sides, so side bits are 0. */
#if P8EST_MAXLEVEL != 19
#error "leaf words have coordinates in units of level 19, and p4est must have the same"
#endif

enum { EXIT_TREE = 2, EXIT_DEPTH = 3 };

const char *const program_name = "p4est-balance";

/* A growing array of leaf words. */
struct words {
    uint64_t *data;
    size_t count;
};

/* Reads the header of a .npy file of 1-D little-endian u64 and returns the number of elements. */
static size_t read_npy_header(FILE *file, const char *path)
{
    unsigned char start[12];
    if (fread(start, 1, 10, file) != 10 || memcmp(start, "\x93NUMPY", 6) != 0)
        fail(EXIT_TREE, "%s is not a .npy file", path);
    size_t length = start[8] | (size_t) start[9] << 8;
    if (start[6] >= 2) {
        if (fread(start + 10, 1, 2, file) != 2)
            fail(EXIT_TREE, "%s ends in its header", path);
        length |= (size_t) start[10] << 16 | (size_t) start[11] << 24;
    }
    if (length > 65536)
        fail(EXIT_TREE, "%s has a header of %zu bytes, more than the 65536 supported", path, length);
    char *header = malloc(length + 1);
    if (header == NULL || fread(header, 1, length, file) != length)
        fail(EXIT_TREE, "%s ends in its header", path);
    header[length] = '\0';
    const char *shape = strstr(header, "'shape': (");
    size_t count;
    char tail[2];
    if (strstr(header, "'<u8'") == NULL || shape == NULL ||
        sscanf(shape, "'shape': (%zu, %1[)]", &count, tail) != 2)
        fail(EXIT_TREE, "%s is not a one-dimensional array of '<u8'", path);
    free(header);
    return count;
}

/* Appends the words of one part. */
static void read_part(const char *path, struct words *words)
{
    FILE *file = fopen(path, "rb");
    if (file == NULL)
        fail(EXIT_TREE, "%s cannot be opened", path);
    size_t count = read_npy_header(file, path);
    words->data = realloc(words->data, (words->count + count + 1) * sizeof(uint64_t));
    if (words->data == NULL)
        fail(EXIT_TREE, "not enough memory for the %zu leaves of %s", count, path);
    if (fread(words->data + words->count, sizeof(uint64_t), count, file) != count)
        fail(EXIT_TREE, "%s has fewer leaves than its header specifies", path);
    words->count += count;
    fclose(file);
}

static int by_value(const void *a, const void *b)
{
    uint64_t left = *(const uint64_t *) a, right = *(const uint64_t *) b;
    return (left > right) - (left < right);
}

/* The words of all parts in a leaf-set directory, sorted. */
static struct words read_tree(const char *directory)
{
    struct words words = {NULL, 0};
    DIR *entries = opendir(directory);
    if (entries == NULL)
        fail(EXIT_TREE, "%s is not a directory", directory);
    for (struct dirent *entry; (entry = readdir(entries)) != NULL;) {
        size_t length = strlen(entry->d_name);
        if (strncmp(entry->d_name, "leaves-", 7) != 0 || length < 4 ||
            strcmp(entry->d_name + length - 4, ".npy") != 0)
            continue;
        char path[4096];
        if (snprintf(path, sizeof path, "%s/%s", directory, entry->d_name) >= (int) sizeof path)
            fail(EXIT_TREE, "the path of %s is too long", entry->d_name);
        read_part(path, &words);
    }
    closedir(entries);
    if (words.count == 0)
        fail(EXIT_TREE, "%s contains no leaves", directory);
    qsort(words.data, words.count, sizeof(uint64_t), by_value);
    return words;
}

/* The coordinate along one axis, from the 19 bits of morton57 that belong to it. */
static p4est_qcoord_t coordinate(uint64_t morton, int axis)
{
    p4est_qcoord_t value = 0;
    for (int bit = 0; bit < 19; ++bit)
        value |= (p4est_qcoord_t) (morton >> (3 * bit + axis) & 1) << bit;
    return value;
}

/* The forest with exactly these leaves. p4est fills gaps to make a tree complete, so the leaves are checked
 * to be contiguous, and the number of leaves is compared with that of the input. */
static p8est_t *forest_of(p8est_t *root, const struct words *words)
{
    p8est_build_t *build = p8est_build_new(root, 0, NULL, NULL);
    uint64_t next = 0;
    for (size_t i = 0; i < words->count; ++i) {
        uint64_t word = words->data[i], morton = word >> 7;
        int level = word >> 2 & 31;
        if (level > P8EST_QMAXLEVEL)
            fail(level > 19 ? EXIT_TREE : EXIT_DEPTH, "leaf %zu has level %d, but the deepest level of p4est is %d",
                 i, level, P8EST_QMAXLEVEL);
        if (morton != next)
            fail(EXIT_TREE, "the tree is not complete: there is a gap or an overlap before leaf %zu", i);
        next = morton + ((uint64_t) 1 << 3 * (19 - level));
        p8est_quadrant_t quadrant;
        P8EST_QUADRANT_INIT(&quadrant);
        quadrant.x = coordinate(morton, 0);
        quadrant.y = coordinate(morton, 1);
        quadrant.z = coordinate(morton, 2);
        quadrant.level = (int8_t) level;
        p8est_build_add(build, 0, &quadrant);
    }
    if (next != (uint64_t) 1 << 57)
        fail(EXIT_TREE, "the tree is not complete: its last leaf does not reach the end of the root");
    p8est_t *forest = p8est_build_complete(build);
    if ((size_t) forest->local_num_quadrants != words->count)
        fail(EXIT_TREE, "the input has %zu leaves, but p4est built a tree of %d", words->count,
             (int) forest->local_num_quadrants);
    return forest;
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

int main(int argc, char **argv)
{
    if (argc != 3) {
        fprintf(stderr, "usage: p4est-balance TREE OUT\n");
        return EXIT_TREE;
    }
    struct words words = read_tree(argv[1]);

    sc_MPI_Init(&argc, &argv);
    sc_init(sc_MPI_COMM_SELF, 0, 0, NULL, SC_LP_ERROR);
    p4est_init(NULL, SC_LP_ERROR);
    p8est_connectivity_t *cube = p8est_connectivity_new_unitcube();
    p8est_t *root = p8est_new_ext(sc_MPI_COMM_SELF, cube, 0, 0, 0, 0, NULL, NULL);
    p8est_t *forest = forest_of(root, &words);
    p8est_destroy(root);
    free(words.data);

    p8est_balance(forest, P8EST_CONNECT_FULL, NULL);
    write_part(argv[2], 0, &p8est_tree_array_index(forest->trees, 0)->quadrants);

    p8est_destroy(forest);
    p8est_connectivity_destroy(cube);
    sc_finalize();
    sc_MPI_Finalize();
    return 0;
}
