/* Loads a forest with one byte of data per quadrant, as `harness export` writes it, saves it again, and balances it.
 *
 *   p4est-load FOREST SAVED
 *
 * The partition is uniform. It prints the number of quadrants, how many of them fill holes (data 3), and what p8est_balance
 * then splits. p4est aborts if the file cannot be loaded or the forest is not valid.
 *
 * Exit codes: 0 success, 2 invalid arguments.
 */
#include <p8est_algorithms.h>
#include <p8est_bits.h>
#include <p8est_communication.h>
#include <p8est_extended.h>
#include <stdio.h>
#include <stdlib.h>

enum { EXIT_ARGUMENTS = 2, FILLER = 3 };

/* Counts on this rank. */
struct counts {
    int64_t fillers, fillers_split, leaves_split;
};

static char *data_of(const p8est_quadrant_t *quadrant)
{
    return (char *) quadrant->p.user_data;
}

/* Called for each octant that balancing splits: its children have its data. */
static void split(p8est_t *forest, p4est_topidx_t tree, int outgoing, p8est_quadrant_t *from[], int incoming,
                  p8est_quadrant_t *to[])
{
    struct counts *counts = forest->user_pointer;
    (void) tree;
    (void) outgoing;
    *(*data_of(from[0]) == FILLER ? &counts->fillers_split : &counts->leaves_split) += 1;
    for (int i = 0; i < incoming; ++i)
        *data_of(to[i]) = *data_of(from[0]);
}

int main(int argc, char **argv)
{
    if (argc != 3) {
        fprintf(stderr, "usage: p4est-load FOREST SAVED\n");
        return EXIT_ARGUMENTS;
    }
    int rank;
    struct counts counts = {0, 0, 0}, sums;
    sc_MPI_Init(&argc, &argv);
    sc_MPI_Comm_rank(sc_MPI_COMM_WORLD, &rank);
    sc_init(sc_MPI_COMM_WORLD, 0, 0, NULL, SC_LP_ERROR);
    p4est_init(NULL, SC_LP_ERROR);

    p8est_connectivity_t *connectivity;
    p8est_t *forest = p8est_load_ext(argv[1], sc_MPI_COMM_WORLD, 1, 1, 1, 0, &counts, &connectivity);
    if (!p8est_is_valid(forest) || !p8est_connectivity_is_valid(connectivity))
        SC_ABORT("the forest is not valid");
    p8est_save(argv[2], forest, 1);
    sc_array_t *quadrants = &p8est_tree_array_index(forest->trees, 0)->quadrants;
    for (size_t i = 0; i < quadrants->elem_count; ++i)
        counts.fillers += *data_of(p8est_quadrant_array_index(quadrants, i)) == FILLER;
    int64_t loaded = forest->global_num_quadrants;
    p8est_balance_ext(forest, P8EST_CONNECT_FULL, NULL, split);
    sc_MPI_Allreduce(&counts, &sums, 3, sc_MPI_LONG_LONG_INT, sc_MPI_SUM, sc_MPI_COMM_WORLD);
    if (rank == 0)
        printf("%lld quadrants, %lld fillers; balance splits %lld fillers and %lld leaves\n", (long long) loaded,
               (long long) sums.fillers, (long long) sums.fillers_split, (long long) sums.leaves_split);

    p8est_destroy(forest);
    p8est_connectivity_destroy(connectivity);
    sc_finalize();
    sc_MPI_Finalize();
    return 0;
}
