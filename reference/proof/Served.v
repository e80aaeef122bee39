(** The walks that decide leastness: [served], and the rules for pairs of marked leaves. *)
From Coq Require Import ZArith List Bool Lia.
Import ListNotations.
From Proof Require Import Statement Checker Causes Octants Sizes Pairs Faces Flood Region Nested Near Sources.
Open Scope Z_scope.

Lemma same_edge a b : octant a -> octant b -> edge a = edge b -> level a = level b.
Proof.
  intros [LA _] [LB _] H. unfold edge in H. destruct (Z.lt_trichotomy (level a) (level b)) as [L|[L|L]]; [exfalso | exact L | exfalso].
  - pose proof (cells_less (level a) (level b) L). pose proof (cells_pos (level b)). lia.
  - pose proof (cells_less (level b) (level a) L). pose proof (cells_pos (level a)). lia.
Qed.

Lemma sources_only_right h t : sources_only t = true -> forall x y z a, In a (flat Outside h x y z t) -> side_of a = Crossing.
Proof.
  intros H x y z a A. destruct t as [[]|m l hs k0 k1 k2 k3 k4 k5 k6 k7]; try discriminate.
  - apply flat_cube in A. destruct A as (sd & SD & ->). cbn [side_in side_of] in *. congruence.
  - destruct h as [|h]; [destruct A|]. apply in_flat in A; [|exact I]. destruct A as (i & j & k & A).
    destruct k0 as [[]|]; try discriminate; destruct k1 as [[]|]; try discriminate; destruct k2 as [[]|]; try discriminate; destruct k3 as [[]|]; try discriminate;
    destruct k4 as [[]|]; try discriminate; destruct k5 as [[]|]; try discriminate; destruct k6 as [[]|]; try discriminate; destruct k7 as [[]|]; try discriminate.
    assert (exists x y z, In a (flat Outside h x y z (Cube Cross))) as (x' & y' & z' & B) by (destruct i, j, k; cbn [kid] in A; eauto).
    apply flat_cube in B. destruct B as (sd & SD & ->). cbn [side_in side_of] in *. congruence.
Qed.

Section Served.
Variable n : Z.
Hypothesis Hn : 1 <= n <= 4096.
Variable V : list leaf.
Hypothesis octants : forall o, In o V -> octant o.

Definition served_right (o : leaf) : Prop := exists q p, child_of o q /\ In p V /\ side_of p = Crossing /\ level p = level o /\
  distance p q < (n - 1) * cells (level p).

Lemma all_served : forall h v, deep h v -> sized Cross h v -> forall X Y W x y z near m, octant (cube X Y W h) -> lists Outside V X Y W h x y z near m ->
  served n v (E h) (E m) x y z near = true -> parent v = true -> forall o, In o (flat Outside h X Y W v) -> side_of o = Outside -> served_right o.
Proof.
  by_tree; [discriminate|].
  intros h v VI D IH S X Y W x y z near m O LI H _ o Q SO.
  pose proof (cube_bounds _ _ _ _ O) as (EP & BX & BY & BZ). rewrite E_S in EP, BX, BY, BZ.
  assert (sub n 1 = n - 1) as N1 by (apply sub_small; unfold small; lia).
  assert (mul (sub n 1) (E h) = (n - 1) * E h) as N2 by (rewrite N1; apply mul_small; unfold small; nia).
  assert ((exists i j k, late (kid i j k v) = true) -> find_around true (E h) (E h) ((n - 1) * E h) (E (Datatypes.S h)) near (E m) x y z = true) as LATE.
  { intros (i & j & k & LT). destruct v as [|a b k0 k1 k2 k3 k4 k5 k6 k7]; [destruct VI|]. cbn [served] in H. rewrite half in H. cbv zeta in H.
    apply andb_prop in H. destruct H as [H _]. rewrite N2 in H.
    match type of H with (if ?b then _ else _) = _ => replace b with true in H; [exact H|] end.
    symmetry. destruct i, j, k; cbn [kid] in LT; rewrite LT, ?orb_true_r; reflexivity. }
  assert (forall i j k, parent (kid i j k v) = true -> sources_only (kid i j k v) = true \/ served n (kid i j k v) (E h) (E (Datatypes.S h)) (off i h) (off j h) (off k h)
    (descend may_serve (E (Datatypes.S h)) (Z.shiftr (add (mul (sub n 1) (E (Datatypes.S h))) 3) 2) near (E m) x y z) = true) as KIDS.
  { intros i j k PK. destruct v as [|a b k0 k1 k2 k3 k4 k5 k6 k7]; [destruct VI|]. cbn [served] in H. rewrite half in H. cbv zeta in H.
    apply andb_prop in H. destruct H as [_ H].
    match type of H with (if ?b then _ else _) = _ => destruct b eqn:SO' end.
    { left. split_and. destruct i, j, k; assumption. }
    right. match type of H with (if ?b then _ else _) = _ => replace b with true in H end.
    - split_and. destruct i, j, k; assumption.
    - symmetry. destruct i, j, k; cbn [kid] in PK; rewrite PK, ?orb_true_r; reflexivity. }
  clear H. apply in_flat in Q; [|exact VI]. destruct Q as (i & j & k & Q).
  destruct (parent (kid i j k v)) eqn:PK.
  - destruct (KIDS i j k PK) as [ON|KS]; [pose proof (sources_only_right h _ ON _ _ _ o Q); congruence|].
    refine (IH i j k _ _ _ _ _ _ _ _ _ _ _ KS PK o Q SO).
    + inversion S as [|? ? ? ? ? K ?]; subst; [destruct VI|]. apply K.
    + apply (cube_kid X Y W h O i j k).
    + apply descend_right; assumption.
  - destruct (kid i j k v) as [q|] eqn:KV; [|discriminate]. apply flat_cube in Q. destruct Q as (sd & SD & ->). cbn [side_of] in SO. subst sd.
    assert (late (Cube q) = true) as LT by (destruct q; cbn [side_in] in SD; (discriminate || reflexivity)).
    assert (E h <= 524288) as HI by lia.
    destruct (find_around_right Outside V true (E h) (E h) ((n - 1) * E h) X Y W (Datatypes.S h) x y z near m HI O LI) as (p & P & HC & ED & DI).
    { apply LATE. exists i, j, k. rewrite KV. exact LT. }
    exists (cube X Y W (Datatypes.S h)), p. split; [apply (same_cube_child X Y W h i j k); [exact O | repeat split]|]. split; [exact P|].
    assert (level p = 19 - Z.of_nat h) as LP.
    { apply (same_edge p (cube (X + off i h) (Y + off j h) (W + off k h) h)); [apply octants; exact P | apply cube_kid; exact O|]. rewrite cube_edge. lia. }
    split; [exact (HC eq_refl)|]. split; [exact LP|].
    rewrite distance_comm, LP, E_cells. exact DI.
Qed.
End Served.

(** Rules for pairs. *)
Section Stops.
Variables n s : Z.
Hypothesis Hn : 1 <= n <= 4096.
Hypothesis Hs : 0 <= s.

Definition late_rule a b := side_of a = Outside -> edge b < edge a -> 0 < distance a b.
Definition source_rule a b := side_of b = Crossing -> 2 * edge b <= edge a -> (n - 1) * edge b <= distance a b.
Lemma source_stop_right : stop_is_right Cross Outside (source_stop n) source_rule.
Proof.
  intros h g t u d Lh Lg S U _ H x y z x' y' z' a b A B DD SC F. unfold source_stop in H.
  pose proof (proj2 (proj2 (proj2 (flat_inside Outside g u (sized_deep Cross _ _ U) _ _ _ _ B)))) as [PB _].
  pose proof B as B'. apply (flat_size Cross) in B'; [|exact U]. apply (flat_size Cross) in A; [|exact S].
  destruct (sized_most Cross h t Lh S) as [M _]. destruct (sized_most Cross g u Lg U) as [M' _].
  apply orb_prop in H. destruct H as [H|H].
  - exfalso. apply negb_true_iff in H. revert SC. refine (flat_has Cross Outside Crossing eq_refl _ g u U H _ _ _ _ B).
    intros k. destruct k; simpl; congruence.
  - apply Z.leb_le in H. rewrite (sub_small n) in H by (unfold small; lia).
    assert (Z.shiftr (most t (E h)) 1 = most t (E h) / 2) as Q by (rewrite Z.shiftr_div_pow2 by lia; reflexivity). rewrite Q in H. clear Q.
    assert (edge b <= most t (E h) / 2) as G by (apply Z.div_le_lower_bound; lia).
    assert (most t (E h) / 2 <= 524288) by (apply Z.div_le_upper_bound; lia).
    assert (edge b <= Z.min (most u (E g)) (most t (E h) / 2)) as G' by (apply Z.min_glb; lia).
    assert (Z.min (most u (E g)) (most t (E h) / 2) <= 524288) as G'' by lia.
    set (w := Z.min _ _) in *. rewrite mul_small in H by (unfold small; nia). nia.
Qed.

Variable below : Z.
Definition marked_rule a b := apart_enough n below a b /\ late_rule a b /\ source_rule a b.
Lemma marked_skip_right : skip_is_right Cross Outside marked_skip marked_rule.
Proof.
  intros h g t u _ _ S U L x y z x' y' z' a b A B. apply Z.leb_le in L.
  pose proof (proj2 (proj2 (proj2 (flat_inside Outside g u (sized_deep Cross _ _ U) _ _ _ _ B)))) as [PB _].
  pose proof (flat_size Cross Outside h t S _ _ _ _ A). pose proof (flat_size Cross Outside g u U _ _ _ _ B).
  split; [intros F; lia | split; [intros _ F; lia | intros _ F; lia]].
Qed.
Lemma marked_stop_right : stop_is_right Cross Outside (marked_stop n (Z.shiftr 2097152 below)) marked_rule.
Proof.
  intros h g t u d Lh Lg S U D H x y z x' y' z' a b A B DD. unfold marked_stop in H.
  apply andb_prop in H. destruct H as [H H3]. apply andb_prop in H. destruct H as [H1 H2]. split; [|split].
  - exact (graded_stop_right Outside n below Hn h g t u d Lh Lg S U D H1 x y z x' y' z' a b A B DD).
  - intros SO F. apply orb_prop in H2. destruct H2 as [H2|H2]; [apply Z.ltb_lt in H2; lia|].
    pose proof (sources_only_right h t H2 _ _ _ a A). congruence.
  - exact (source_stop_right h g t u d Lh Lg S U D H3 x y z x' y' z' a b A B DD).
Qed.

Definition extra_rule a b := side_of b = Crossing -> s < edge a \/ s <= edge a /\ side_of a = Outside -> 0 < distance a b.
Lemma extra_skip_right : skip_is_right Cross Outside (extra_skip s) extra_rule.
Proof.
  intros h g t u Lh Lg S U H x y z x' y' z' a b A B SC F. exfalso. unfold extra_skip in H.
  pose proof A as A'. apply (flat_size Cross) in A'; [|exact S]. apply orb_prop in H. destruct H as [H|H].
  - assert ((exists k, t = Cube k /\ k = Cross /\ E h <= s) \/ most t (E h) < s) as [(k & -> & -> & L)|L].
    { destruct t as [[]|]; first [left; exists Cross; split; [reflexivity|]; split; [reflexivity|]; apply Z.leb_le; exact H | right; apply Z.ltb_lt; exact H]. }
    + apply flat_cube in A. destruct A as (sd & SD & ->). cbn [side_in side_of] in *. unfold edge in F. cbn [level] in F. rewrite E_cells in F.
      destruct F as [F | [_ F]]; [lia | congruence].
    + lia.
  - apply negb_true_iff in H. revert SC. refine (flat_has Cross Outside Crossing eq_refl _ g u U H _ _ _ _ B).
    intros k. destruct k; simpl; congruence.
Qed.
Lemma extra_stop_right : stop_is_right Cross Outside extra_stop extra_rule.
Proof. intros h g t u d _ _ _ _ _ H x y z x' y' z' a b _ _ DD _ _. apply Z.ltb_lt in H. lia. Qed.
End Stops.
