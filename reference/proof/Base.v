(** The kept region: walks over all leaves of a tree, and over two trees at once; and what is accepted of T0. *)
From Coq Require Import ZArith List Bool Lia Permutation Relations.
Import ListNotations.
From Proof Require Import Statement Checker Check Octants Reading Pairs Flood Counts.
Open Scope Z_scope.

(** * Walks over the kept region *)

Lemma every_kids f t : inner t -> every f t = true -> forall i j k, every f (kid i j k t) = true.
Proof. destruct t; [contradiction|]. intros _ H i j k. cbn [every] in H. split_and. destruct i, j, k; assumption. Qed.
Lemma every_look f : forall h t, deep h t -> every f t = true -> forall x y z u v w, f (look h x y z u v w t) = true.
Proof.
  by_tree.
  - intros h k H x y z u v w. rewrite look_cube. exact H.
  - intros n t T _ IH H x y z u v w. destruct (look_kid n x y z u v w t) as (i & j & k & -> & _). apply IH. apply every_kids; assumption.
Qed.
(** If not every cube passes, one that does not is somewhere. *)
Lemma some_look f : forall h t, deep h t -> every f t = false -> forall x y z, exists u v w, in_cube h x y z u v w /\ f (look h x y z u v w t) = false.
Proof.
  by_tree.
  - intros h k H x y z. exists x, y, z. rewrite look_cube. pose proof (E_pos h). split; [unfold in_cube; lia | exact H].
  - intros n t T _ IH H x y z.
    assert (exists i j k, every f (kid i j k t) = false) as (i & j & k & F).
    { destruct t as [| p q r a b c d e f' g h]; [contradiction|]. cbn [every] in H.
      apply andb_false_iff in H. destruct H as [H|H]; [|exists true, true, true; exact H].
      apply andb_false_iff in H. destruct H as [H|H]; [|exists false, true, true; exact H].
      apply andb_false_iff in H. destruct H as [H|H]; [|exists true, false, true; exact H].
      apply andb_false_iff in H. destruct H as [H|H]; [|exists false, false, true; exact H].
      apply andb_false_iff in H. destruct H as [H|H]; [|exists true, true, false; exact H].
      apply andb_false_iff in H. destruct H as [H|H]; [|exists false, true, false; exact H].
      apply andb_false_iff in H. destruct H as [H|H]; [exists false, false, false; exact H | exists true, false, false; exact H]. }
    destruct (IH i j k F (x + off i n) (y + off j n) (z + off k n)) as (u & v & w & P & Q). exists u, v, w.
    destruct (look_in_kid n x y z u v w t i j k P) as [L P']. rewrite L. auto.
Qed.

Lemma fine_right k0 s0 s : s0 <> Crossing -> forall h t, sized k0 h t -> fine_tree s t (E h) = true ->
  forall x y z o, In o (flat s0 h x y z t) -> side_of o = Crossing -> edge o <= s.
Proof.
  intros NC h t S. induction S as [h k | n t T M L K IH B]; intros H x y z o O C.
  - pose proof (flat_size k0 s0 h (Cube k) (sized_cube k0 h k) x y z o O) as SZ.
    assert (fine_tree s (Cube k) (E h) = if most (Cube k) (E h) <=? s then true else negb (same Cross k)) as Q by reflexivity. rewrite Q in H.
    destruct (Z.leb_spec (most (Cube k) (E h)) s); [lia|]. apply flat_cube in O. destruct O as (s1 & K & ->). cbn [side_of] in C. subst s1.
    destruct k; cbn [side_in same negb] in *; congruence.
  - pose proof (flat_size k0 s0 (S n) t (sized_node k0 n t T M L K B) x y z o O) as SZ.
    destruct (Z.leb_spec (most t (E (S n))) s) as [G|G]; [lia|].
    assert (forall i j k, fine_tree s (kid i j k t) (E n) = true) as F.
    { destruct t; [contradiction|]. cbn [fine_tree] in H. apply Z.leb_gt in G. rewrite G, half in H. cbv zeta in H. split_and.
      intros i j k. destruct i, j, k; assumption. }
    apply in_flat in O; [|exact T]. destruct O as (i & j & k & O). exact (IH i j k (F i j k) _ _ _ _ O C).
Qed.

Lemma filled_look k : forall h t, deep h t -> filled k t = true -> forall x y z u v w, look h x y z u v w t = k.
Proof.
  by_tree.
  - intros h k' H x y z u v w. rewrite look_cube. symmetry. apply same_eq. exact H.
  - intros n t T _ IH H x y z u v w. destruct (look_kid n x y z u v w t) as (i & j & l & -> & _). apply IH.
    destruct t; [contradiction|]. cbn [filled] in H. split_and. destruct i, j, l; assumption.
Qed.

Section Overlay.
Variable fate : kind -> kind.
Hypothesis fate_empty : fate Empty = Empty.

Lemma overlay_kids t u : inner t -> overlay fate t u = true -> (u = Cube Empty \/ inner u) /\
  forall i j k, overlay fate (kid i j k t) (kid i j k u) = true.
Proof.
  destruct t as [| p q r a b c d e f g h]; [contradiction|]. intros _ H. cbn [overlay] in H. destruct u as [[]|]; try discriminate; split_and;
  (split; [simpl; tauto|]); intros i1 i2 i3; destruct i1, i2, i3; assumption.
Qed.

Lemma overlay_look : forall h t, deep h t -> forall u x y z a b c, deep h u -> overlay fate t u = true ->
  look h x y z a b c u = fate (look h x y z a b c t).
Proof.
  by_tree.
  - intros h k u x y z a b c D H. rewrite look_cube. apply filled_look; assumption.
  - intros n t T _ IH u x y z a b c D H. apply overlay_kids in H; [|exact T]. destruct H as [_ H].
    destruct (look_kid n x y z a b c t) as (i & j & k & -> & P & Q & R).
    rewrite (look_at n x y z a b c u i j k P Q R). apply IH; [apply deep_Kid; exact D | apply H].
Qed.

Lemma overlay_within s0 : forall h t, deep h t -> forall u x y z o, deep h u -> overlay fate t u = true -> In o (flat s0 h x y z u) ->
  (forall s, side_in s0 (fate Empty) = Some s -> False) -> exists b, In b (flat s0 h x y z t) /\ within o b.
Proof.
  by_tree.
  - intros h k u x y z o D H O _. pose proof (filled_look _ h u D H x y z) as F.
    destruct (flat_look s0 h u D x y z o O) as (k' & S & L). pose proof (flat_inside s0 h u D x y z o O) as B.
    assert (holds o (cx o) (cy o) (cz o)) as HC by (unfold holds; lia). rewrite <- (L _ _ _ HC), F in S.
    assert (exists s, side_in s0 k = Some s) as (s & K) by (destruct k; try (eexists; reflexivity); rewrite fate_empty in S; discriminate).
    exists (Leaf x y z (19 - Z.of_nat h) s). split; [apply flat_cube; exists s; auto|]. intros p q r Q. apply cube_holds.
    unfold holds, in_cube in *. lia.
  - intros n t T _ IH u x y z o D H O N. apply overlay_kids in H; [|exact T]. destruct H as [[-> | U] H]; [destruct O|].
    apply in_flat in O; [|exact U]. destruct O as (i & j & k & O).
    destruct (IH i j k (kid i j k u) _ _ _ o (deep_Kid n u i j k D) (H i j k) O N) as (b & B & W).
    exists b. split; [apply in_flat; [exact T | exists i, j, k; exact B] | exact W].
Qed.
End Overlay.

(** * T0 *)

(** The kernel compares definitions before walks, which it would otherwise unfold twenty levels deep. *)
Strategy expand [check check_inputs check_full check_base check_crossing check_graded].
Strategy opaque [faces face flood rounds sweeps walk spot mark every overlay fine_tree rim wet look flat deep].

Lemma outside_neighbour o u v w u' v' w' : octant o -> holds o u v w -> ~ in_root u' v' w' ->
  Z.abs (u - u') + Z.abs (v - v') + Z.abs (w - w') = 1 -> at_boundary o.
Proof.
  intros (L & _ & _ & _ & IR) P N S.
  assert (0 < edge o) by (unfold edge, cells; apply Z.pow_pos_nonneg; lia).
  assert (in_root (cx o) (cy o) (cz o)) as A by (apply IR; unfold holds; lia).
  assert (in_root (cx o + edge o - 1) (cy o + edge o - 1) (cz o + edge o - 1)) as B by (apply IR; unfold holds; lia).
  unfold at_boundary, in_root, holds in *. set (m := cells 0) in *. clearbody m. clear IR L.
  destruct (Z.eq_dec (cx o) 0); [tauto|]. destruct (Z.eq_dec (cy o) 0); [tauto|]. destruct (Z.eq_dec (cz o) 0); [tauto|].
  destruct (Z.eq_dec (cx o + edge o) m); [tauto|]. destruct (Z.eq_dec (cy o + edge o) m); [tauto|].
  destruct (Z.eq_dec (cz o + edge o) m); [tauto|]. exfalso. apply N. lia.
Qed.

Lemma fold_keeps {A B} (P : A -> Prop) (f : A -> B -> A) l : (forall b a, In b l -> P a -> P (f a b)) -> forall a, P a -> P (fold_left f l a).
Proof.
  induction l as [| b l IH]; intros F a Pa; [exact Pa|]. apply IH; [intros; apply F; [right|]; assumption|].
  apply F; [left; reflexivity | exact Pa].
Qed.

Lemma flat_linear s0 h t : h = 19%nat -> deep h t -> (forall o, In o (flat s0 h 0 0 0 t) -> octant o) /\ ForallOrdPairs disjoint (flat s0 h 0 0 0 t).
Proof.
  intros H D. pose proof (Eh h H) as EH. split; [|apply flat_disjoint; exact D]. intros o O.
  pose proof (flat_inside s0 h t D 0 0 0 o O) as (BX & BY & BZ & PE & L).
  destruct (flat_aligned s0 h t D 0 0 0 o) as (A & B & C); try apply Z.divide_0_r; [exact O|].
  split; [rewrite H in L; lia|]. split; [exact A|]. split; [exact B|]. split; [exact C|].
  intros u v w P. unfold in_root, holds in *. replace (cells 0) with (E h) by (rewrite EH; reflexivity). lia.
Qed.

Lemma linear_permutation l m : Permutation l m -> linear l -> linear m.
Proof.
  intros P [A B]. split.
  - intros a I. apply A. apply (Permutation_in a (Permutation_sym P)). exact I.
  - apply (pairs_permutation disjoint disjoint_sym l m P B).
Qed.

Section Base.
Variable c : inputs.
Variable L : list leaf.
Variable t : tree.
Variable h : nat.
Hypothesis H19 : h = 19%nat.
Hypothesis D : deep h t.
Local Notation s0 := (flow c).
Local Notation k0 := (kind_of_flow c).
Hypothesis LP : Permutation (flat s0 h 0 0 0 t) L.
Hypothesis OK : check_base c t = true.

Lemma K0 : side_in s0 k0 = Some s0.
Proof. unfold flow, kind_of_flow. destruct (keep c); reflexivity. Qed.
Lemma s0_crossing : s0 <> Crossing.
Proof. unfold flow. destruct (keep c); discriminate. Qed.
Lemma in_L a : In a L <-> In a (flat s0 h 0 0 0 t).
Proof. split; [apply (Permutation_in a (Permutation_sym LP)) | apply (Permutation_in a LP)]. Qed.
Lemma L_linear : linear L.
Proof. apply (linear_permutation _ _ LP). apply flat_linear; assumption. Qed.
Lemma corner a : In a L -> holds a (cx a) (cy a) (cz a).
Proof. intros A. apply in_L in A. apply (flat_inside s0 h t D) in A. unfold holds. lia. Qed.
Lemma root_h u v w : in_root u v w <-> in_cube h 0 0 0 u v w.
Proof. apply root_cube. exact H19. Qed.

(** The kind of a leaf in the flooded tree. *)
Definition of_kind a k := In a L /\ side_in s0 k = Some (side_of a) /\ forall u v w, holds a u v w -> look h 0 0 0 u v w t = k.
Lemma has_kind a : In a L -> exists k, of_kind a k.
Proof. intros A. destruct (flat_look s0 h t D 0 0 0 a (proj1 (in_L a) A)) as (k & S & K). exists k. repeat split; assumption. Qed.
Lemma one_kind a k k' : of_kind a k -> of_kind a k' -> k = k'.
Proof. intros (A & _ & K) (_ & _ & K'). rewrite <- (K _ _ _ (corner a A)). apply K', corner, A. Qed.

Lemma adjacent_kind a b k k' : adjacent L a b -> of_kind a k -> of_kind b k' -> k = k'.
Proof.
  intros (A & B & CA & CB & F) (_ & SA & KA) (_ & SB & KB).
  unfold check_base in OK. apply andb_prop in OK. destruct OK as [OK1 _]. apply andb_prop in OK1. destruct OK1 as [OF _].
  apply (shared_kind s0 k0 t h H19 D a b OF (proj1 (in_L a) A) (proj1 (in_L b) B) CA CB F k k' KA KB SA SB).
Qed.
Lemma connected_kind a b k : connected L a b -> of_kind a k -> of_kind b k.
Proof.
  intros C. revert k. induction C as [a b AB | a | a b d _ IH1 _ IH2]; intros k K; auto.
  destruct (has_kind b (proj1 (proj2 AB))) as (k' & K'). rewrite (adjacent_kind a b k k' AB K K'). exact K'.
Qed.
Lemma connected_in a b : connected L a b -> In b L -> In a L.
Proof. induction 1 as [a b AB | a | a b d _ IH1 _ IH2]; auto. intros _. exact (proj1 AB). Qed.
Lemma connected_side a b : connected L a b -> side_of a = side_of b.
Proof.
  induction 1 as [a b AB | a | a b d _ IH1 _ IH2]; [| reflexivity | congruence].
  destruct (has_kind a (proj1 AB)) as (k & K). pose proof (connected_kind a b k (rt_step _ _ _ _ AB) K) as K'.
  destruct K as (_ & S & _), K' as (_ & S' & _). congruence.
Qed.

(** Reached cells. *)
Variable start : leaf -> Prop.
Variable beyond : Prop.
Definition reached u v w := (beyond /\ ~ in_root u v w) \/
  exists a b, In a L /\ In b L /\ start b /\ side_of a = s0 /\ connected L a b /\ holds a u v w.
Definition true_tree := truth reached h 0 0 0 t.

Lemma reached_kind a : true_tree -> of_kind a Reached -> exists b, In b L /\ start b /\ connected L a b.
Proof.
  intros TR (A & S & K). pose proof (corner a A) as P. assert (in_root (cx a) (cy a) (cz a)) as IR by (apply (proj1 L_linear a A); exact P).
  destruct (TR (cx a) (cy a) (cz a)) as [[_ N] | (a' & b & A' & B & ST & _ & C & P')]; [apply root_h; exact IR | apply K; exact P | contradiction |].
  exists b. rewrite (in_pairs a a' L (proj2 L_linear) A A' _ _ _ P P'). auto.
Qed.
End Base.

Lemma reached_spreads c L (start : leaf -> Prop) (beyond : Prop) : linear L -> (beyond -> forall o, at_boundary o -> start o) -> flow c <> Crossing ->
  forall o, In o L -> side_of o = flow c -> spreads (reached c L start beyond) o.
Proof.
  intros LI ST NC o O S u v w u' v' w' P N RR p q r Q. right.
  destruct RR as [[B NR] | (a & b & A & B & SB & SA & C & P')].
  - exists o, o. split; [exact O|]. split; [exact O|]. split; [|split; [exact S | split; [apply rt_refl | exact Q]]].
    apply (ST B), (outside_neighbour o u v w u' v' w'); trivial. apply (proj1 LI o O).
  - exists o, b. split; [exact O|]. split; [exact B|]. split; [exact SB|]. split; [exact S|]. split; [|exact Q].
    apply rt_trans with a; [apply rt_step | exact C].
    split; [exact O|]. split; [exact A|]. split; [congruence|]. split; [congruence|]. exists u, v, w, u', v', w'. auto.
Qed.

Section Whole.
Variable c : inputs.
Variables base mesh dropped : list part.
Variables of_base of_mesh : manifest.
Local Notation L := (leaves base).
Local Notation s0 := (flow c).
Local Notation k0 := (kind_of_flow c).

Lemma has_seeds_right : has_seeds c = true <-> seeds c <> [].
Proof. unfold has_seeds. destruct (seeds c); split; congruence. Qed.
Lemma may_enclose_right : may_enclose c = true <-> keep c = Keep_outside /\ seeds c = [] /\ delete_enclosed c = true.
Proof.
  unfold may_enclose, has_seeds. destruct (keep c), (seeds c); cbn [negb andb]; split; try discriminate; try tauto; intros (? & ? & ?); congruence.
Qed.

Section Flooded.
Variable h : nat.
Hypothesis H19 : h = 19%nat.
Variable t0 : tree.
Hypothesis D0 : deep h t0.
Hypothesis LP : Permutation (flat s0 h 0 0 0 t0) L.
Hypothesis dry : every (fun k => negb (same Empty k) && negb (same Reached k)) t0 = true.

Lemma dry_look u v w : look h 0 0 0 u v w t0 <> Empty /\ look h 0 0 0 u v w t0 <> Reached.
Proof. pose proof (every_look _ h t0 D0 dry 0 0 0 u v w) as Q. cbv beta in Q. split; intros R; rewrite R in Q; discriminate. Qed.

Lemma base_tiles : tiles L.
Proof.
  split; [apply (linear_permutation _ _ LP); apply flat_linear; assumption|]. intros u v w P.
  assert (in_cube h 0 0 0 u v w) as (A & B & C) by (apply (root_cube h H19); exact P).
  destruct (dry_look u v w) as [N _]. assert (exists s, side_in s0 (look h 0 0 0 u v w t0) = Some s) as (s & S)
    by (destruct (look h 0 0 0 u v w t0); try (eexists; reflexivity); congruence).
  destruct (look_flat s0 h t0 D0 0 0 0 u v w s A B C S) as (o & O & HO & _). exists o. split; [|exact HO]. apply (Permutation_in o LP). exact O.
Qed.

Lemma dry_kept (R : Z -> Z -> Z -> Prop) : kept_leaves s0 R (flat s0 h 0 0 0 t0) h t0.
Proof. split; [|reflexivity]. split; [exact D0|]. intros u v w _ Q. destruct (dry_look u v w) as [_ N]. contradiction. Qed.

Lemma spread_all (start : leaf -> Prop) (beyond : Prop) : (beyond -> forall o, at_boundary o -> start o) ->
  forall o, In o (flat s0 h 0 0 0 t0) -> side_of o = s0 -> spreads (reached c L start beyond) o.
Proof.
  intros B o O. apply reached_spreads; [apply base_tiles | exact B | apply s0_crossing | apply (Permutation_in o LP); exact O].
Qed.

Lemma good_cube (R : Z -> Z -> Z -> Prop) x y z k : (k = Reached -> forall u v w, in_cube h x y z u v w -> R u v w) -> good R h x y z (Cube k).
Proof.
  intros K. split; [destruct h; exact I|]. intros u v w P Q. rewrite look_cube in Q. apply K; assumption.
Qed.

(** Seeds. *)
Lemma mark_h k u v w t : mark k 19 u v w 0 0 0 524288 t = mark k h u v w 0 0 0 (E h) t.
Proof. rewrite (Eh h H19), H19. reflexivity. Qed.
Lemma mark_seed p q r t : In (p, q, r) (seeds c) -> in_root (p / 256) (q / 256) (r / 256) ->
  kept_leaves s0 (reached c L (seed_in c) False) (flat s0 h 0 0 0 t0) h t ->
  kept_leaves s0 (reached c L (seed_in c) False) (flat s0 h 0 0 0 t0) h
    (mark (kind_of_flow c) 19 (Z.shiftr p 8) (Z.shiftr q 8) (Z.shiftr r 8) 0 0 0 524288 t).
Proof.
  intros S P [G F]. rewrite mark_h. assert (forall m, Z.shiftr m 8 = m / 256) as SH by (intros; rewrite Z.shiftr_div_pow2 by lia; reflexivity).
  rewrite !SH. pose proof (Eh h H19) as EH.
  destruct (mark_right s0 (kind_of_flow c) (K0 c) (reached c L (seed_in c) False) (p / 256) (q / 256) (r / 256) h t (proj1 G) 0 0 0) as [G' F'];
    try lia; try (rewrite EH; lia); [apply (root_cube h H19); exact P | exact G | |].
  - intros o O SO HO u v w Q. right. rewrite F in O. apply (Permutation_in o LP) in O. exists o, o.
    split; [exact O|]. split; [exact O|]. split; [exists p, q, r; auto|]. split; [exact SO|]. split; [apply rt_refl | exact Q].
  - split; [exact G' | rewrite F'; exact F].
Qed.
Lemma mark_seeds_right : (forall p q r, In (p, q, r) (seeds c) -> in_root (p / 256) (q / 256) (r / 256)) ->
  kept_leaves s0 (reached c L (seed_in c) False) (flat s0 h 0 0 0 t0) h (mark_seeds c t0).
Proof.
  intros IR. apply (fold_keeps (kept_leaves s0 (reached c L (seed_in c) False) (flat s0 h 0 0 0 t0) h)); [|apply dry_kept].
  intros [[p q] r] t S K. apply mark_seed; [exact S | apply IR; exact S | exact K].
Qed.

Definition started : leaf -> Prop := if has_seeds c then seed_in c else at_boundary.
Definition outer : Prop := if has_seeds c then False else True.

(** What the flood keeps and what it reaches. *)
Lemma flooded_right : (has_seeds c = true -> forall p q r, In (p, q, r) (seeds c) -> in_root (p / 256) (q / 256) (r / 256)) ->
  kept_leaves s0 (reached c L started outer) (flat s0 h 0 0 0 t0) h (flooded c t0).
Proof.
  intros IR. unfold flooded. generalize 100%nat as fuel. intros fuel.
  assert (forall o, In o (flat s0 h 0 0 0 t0) -> side_of o = s0 -> spreads (reached c L started outer) o) as SP.
  { apply spread_all. unfold outer, started. destruct (has_seeds c); [contradiction | trivial]. }
  unfold started, outer in *. destruct (has_seeds c) eqn:HS.
  - apply rounds_right; [apply K0 | exact SP | | apply mark_seeds_right; auto].
    intros s. split; [|split]; apply good_cube; intros Q; discriminate Q.
  - destruct (may_enclose c) eqn:ME; [|apply dry_kept].
    assert (kind_of_flow c = Outer) as KO by (unfold kind_of_flow; apply may_enclose_right in ME; destruct ME as (-> & _); reflexivity).
    rewrite <- KO. apply rounds_right; [apply K0 | exact SP | | apply dry_kept].
    pose proof (E_pos h) as PE. assert (forall u v w, in_root u v w <-> in_cube h 0 0 0 u v w) as RC by (intros; apply root_cube; exact H19).
    intros s. split; [|split]; apply good_cube; intros _ u v w P; left; (split; [exact I|]); rewrite RC; unfold in_cube, back in *; destruct s; lia.
Qed.
End Flooded.
End Whole.
