use super::*;

#[test]
fn all_messages_arrive_for_every_seed() {
    for seed in 0..20 {
        let sums = run(7, seed, |c| {
            let to = (0..c.size())
                .filter(|r| r % 2 == 0)
                .map(|r| (r, vec![c.rank() as u64; 2]))
                .collect();
            let received: u64 = c.sparse_all_to_all(to).messages().map(|l| l.1[0]).sum();
            (c.sum(c.rank() as u64), received)
        });
        for (rank, (sum, received)) in sums.into_iter().enumerate() {
            assert_eq!(sum, 21);
            assert_eq!(received, if rank % 2 == 0 { 21 } else { 0 });
        }
    }
}

#[test]
fn the_order_of_arrival_depends_on_the_seed_alone() {
    let order = |seed| {
        let senders = |message_buffer: MessageBuffer| {
            message_buffer.messages().map(|l| l.0).collect::<Vec<_>>()
        };
        run(6, seed, |c| senders(c.sparse_all_to_all(MessageBuffer::of_entries(vec![(0, [1])]))))
            .swap_remove(0)
    };
    assert_eq!(order(3), order(3));
    assert!((0..10).any(|s| order(s) != order(3)));
}

#[test]
#[should_panic(expected = "rank two fails")]
fn a_panic_on_one_rank_stops_all() {
    run(4, 1, |c| {
        assert!(c.rank() != 2, "rank two fails");
        c.sum(1)
    });
}

#[test]
#[should_panic(expected = "another simulated rank")]
fn a_rank_that_ends_early_does_not_leave_the_others_waiting() {
    run(3, 1, |c| if c.rank() == 0 { 0 } else { c.sum(1) });
}
