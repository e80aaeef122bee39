(** The whole of gradation: what [check_graded] accepts has its layers and is least. *)
From Coq Require Import ZArith List Bool Lia Permutation.
Import ListNotations.
From Proof Require Import Statement Checker Causes Check Octants Sizes Pairs Nested Unique Near Sources Served Least.
Open Scope Z_scope.
Strategy opaque [walk overlay flat deep mark_sources served].

Lemma if_true (b x : bool) : b = true -> (if b then x else true) = true -> x = true.
Proof. intros ->. trivial. Qed.

Lemma rest_right c t g rest : check_graded c t g rest = true -> rest tt = true.
Proof. unfold check_graded, both. intros H. apply andb_prop in H. destruct H as [_ H]. apply andb_prop in H. apply H. Qed.

Section Graded.
Variable c : inputs.
Variables base mesh dropped : list leaf.
Let graded := mesh ++ dropped.
Hypothesis G : region c base mesh dropped.
Hypothesis Hn : 1 <= layer_cells c <= 4096.
Hypothesis Hs : 0 <= surface c <= 19.
Variables t g : tree.
Variable s1 : side.
Variable fate : kind -> kind.
Hypothesis fate_empty : fate Empty = Empty.
Hypothesis T : deep 19 t.
Hypothesis LB : forall b, In b (flat s1 19 0 0 0 t) <-> In b base.
Hypothesis SG : sized Cross 19 g.
Hypothesis LG : forall a, In a (flat Outside 19 0 0 0 g) <-> In a graded.
Hypothesis OV : overlay fate t g = true.
Variable rest : unit -> bool.
Hypothesis OK : check_graded c t g rest = true.

Lemma root_octant : octant (cube 0 0 0 19).
Proof.
  split; [cbn; lia|]. rewrite cube_edge, E_root. cbn [cube cx cy cz]. do 3 (split; [apply Z.divide_0_r|]).
  intros u v w. unfold holds, in_root. rewrite cube_edge, E_root. cbn [cube cx cy cz]. replace (cells 0) with 524288 by reflexivity. lia.
Qed.
Lemma root_list L u : sized Cross 19 u -> (forall o, In o (flat Outside 19 0 0 0 u) -> In o L) -> lists Outside L 0 0 0 19 0 0 0 (Also u 0 0 0 Nobody) 19.
Proof.
  intros S I. split; [|unfold in_range; split; [lia|]; split; [lia|]; split; [lia|]; right; auto].
  constructor; [exact root_octant | exact S | exact I | constructor].
Qed.

Definition s := cells (surface c).
Lemma surface_right : Z.shiftr 524288 (surface c) = s.
Proof.
  unfold s, cells. rewrite Z.shiftr_div_pow2 by lia. change 524288 with (2 ^ 19). rewrite <- Z.pow_sub_r by lia. reflexivity.
Qed.
Lemma extra_right : extra c = true <-> keep_crossing c = false /\ layer_cells c < 3.
Proof. unfold extra. rewrite andb_true_iff, negb_true_iff, Z.ltb_lt. reflexivity. Qed.

Let m := mark_sources s (extra c) t g 524288 524288 0 0 0 (Also g 0 0 0 Nobody) false.
Let V := flat Outside 19 0 0 0 m.
Let n := layer_cells c.
Lemma parts : walk_marked n (Z.shiftr 2097152 (below c)) m = true /\ (extra c = true -> walk_extra s m g = true) /\ served n m 524288 524288 0 0 0 (Also m 0 0 0 Nobody) = true.
Proof.
  unfold check_graded in OK. cbv zeta in OK. rewrite surface_right in OK. unfold both in OK. apply andb_prop in OK. destruct OK as [A B].
  apply andb_prop in B. destruct B as [B _]. apply andb_prop in B. destruct B as [B C].
  split; [exact A|]. split; [|exact C]. intros X. exact (if_true _ _ X B).
Qed.

Lemma all_marked : sized Cross 19 m /\ (forall o, In o graded -> exists o', In o' V /\ same_cube o o') /\
  (forall o', In o' V -> exists o, In o graded /\ same_cube o o') /\ (parent g = true -> forall o, In o V -> marked_right c base mesh dropped V o).
Proof.
  assert (forall o, In o graded -> exists b, In b base /\ within o b /\ side_of o = side_of b) as HOME.
  { intros o O. destruct (home c base mesh dropped G o O) as (b & B & _ & W & S & _). exists b. auto. }
  pose proof (mark_right c base mesh dropped s (extra c) (conj Hs eq_refl) (proj1 extra_right) HOME (graded_octant c base mesh dropped G) s1 fate fate_empty
    19 g (sized_deep _ _ _ SG) SG t 0 0 0 0 0 0 (Also g 0 0 0 Nobody) 19 false root_octant T OV) as M. rewrite E_root in M. fold m in M.
  destruct M as (M1 & M2 & M3 & M4).
  - apply root_list; [exact SG|]. intros o. apply LG.
  - intros o. apply LG.
  - intros _ b. apply LB.
  - intros b B IN. apply LB in B. split; [|exact B]. destruct t as [k|]; [|exact I]. apply flat_cube in B. destruct B as (sd & _ & ->).
    destruct IN as [_ L]. cbn [level cube] in L. lia.
  - split; [exact M1|]. split; [intros o O; apply M2, LG, O|]. split; [|exact M4].
    intros o O. destruct (M3 o O) as (a & A & S). exists a. split; [apply LG; exact A | exact S].
Qed.
Lemma V_octant o : In o V -> octant o.
Proof.
  destruct all_marked as (_ & _ & M & _). intros O. destruct (M o O) as (a & A & S). apply (same_cube_octant a o S).
  exact (graded_octant c base mesh dropped G a A).
Qed.
Lemma m_parent : parent m = parent g.
Proof. unfold m. destruct g as [[]|]; try reflexivity. cbn [mark_sources]. destruct (_ || parent _); [reflexivity|]. destruct (_ && _); [rewrite twig_right; reflexivity | reflexivity]. Qed.
(** Only the root has no parent. *)
Lemma has_parent o : In o V -> 1 <= level o -> parent m = true.
Proof.
  intros O L. destruct (parent m) eqn:P; [reflexivity|]. exfalso. unfold V in O. destruct m as [k|]; [|discriminate].
  apply flat_cube in O. destruct O as (sd & _ & ->). cbn [level] in L. lia.
Qed.

Lemma all_pairs a b : In a V -> In b V -> marked_rule n (below c) a b.
Proof.
  pose proof (proj1 parts) as W. pose proof (proj1 all_marked) as M. revert a b.
  exact (walk_all Outside _ _ _ (marked_skip_right n (below c)) (marked_stop_right n Hn (below c)) m m M M W).
Qed.

Lemma layers_right : layers c mesh dropped.
Proof.
  intros l a b A B LT LA LB'. destruct all_marked as (M & TO & _). destruct (TO a A) as (a' & A' & SA). destruct (TO b B) as (b' & B' & SB).
  pose proof (graded_octant c base mesh dropped G a A) as [LE _].
  rewrite (same_cube_distance a a' b SA), distance_comm, (same_cube_distance b b' a' SB), distance_comm.
  refine (all_layers Outside m M n (below c) Hn _ (fun p q P Q => proj1 (all_pairs p q P Q)) l a' b' A' B' _ _ _).
  - unfold below. destruct (keep c); lia.
  - unfold below. destruct LT as [LT | ->]; [destruct (keep c)|]; lia.
  - destruct SA as (_ & _ & _ & <-). exact LA.
  - destruct SB as (_ & _ & _ & <-). exact LB'.
Qed.

Lemma gradation_least : Statement.least c base mesh dropped.
Proof.
  destruct all_marked as (M & TO & FROM & MARK).
  apply (least_right c base mesh dropped Hs G V TO FROM).
  - intros a A L. apply MARK; [|exact A]. rewrite <- m_parent. exact (has_parent a A L).
  - intros a A L SO. refine (all_served n Hn V V_octant 19 m (sized_deep _ _ _ M) M 0 0 0 0 0 0 (Also m 0 0 0 Nobody) 19 root_octant (root_list V m M (fun o O => O)) _ (has_parent a A L) a A SO).
    rewrite E_root. apply parts.
  - intros a b A B F. destruct (all_pairs a b A B) as (P & _). exact (proj2 (P F)).
  - intros a b A B. apply (all_pairs a b A B).
  - intros a b A B. apply (all_pairs a b A B).
  - intros KC N3 a b A B. destruct parts as (_ & P & _). specialize (P (proj2 extra_right (conj KC N3))). apply LG in B.
    assert (0 <= s) as S0 by (unfold s, cells; apply Z.pow_nonneg; lia).
    exact (walk_all Outside _ _ _ (extra_skip_right s) (extra_stop_right s) m g M SG P a b A B).
Qed.
End Graded.
