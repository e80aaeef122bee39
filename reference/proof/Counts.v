(** Counts: the numbers of a manifest are those of the leaves. *)
From Coq Require Import ZArith List Bool Lia Permutation.
Import ListNotations.
From Proof Require Import Statement Checker Octants Reading.
Open Scope Z_scope.

Lemma number_app f l m : number f (l ++ m) = number f l + number f m.
Proof. unfold number. rewrite filter_app, app_length, Nat2Z.inj_add. reflexivity. Qed.
Lemma number_permutation f l m : Permutation l m -> number f l = number f m.
Proof.
  intros P. unfold number. f_equal. induction P as [| a l m P IH | a b l | l m n _ IH1 _ IH2]; [reflexivity | | | congruence].
  - simpl. destruct (f a); simpl; rewrite IH; reflexivity.
  - simpl. destruct (f a), (f b); reflexivity.
Qed.
Lemma number_pos f l : 0 <= number f l. Proof. unfold number. lia. Qed.
Lemma number_none f l : (forall a, In a l -> f a = false) -> number f l = 0.
Proof.
  intros H. unfold number. induction l as [| a l IH]; [reflexivity|]. simpl.
  rewrite (H a) by (left; reflexivity). apply IH. intros b B. apply H. right. exact B.
Qed.
Lemma number_ext f g l : (forall a, In a l -> f a = g a) -> number f l = number g l.
Proof. intros H. unfold number. rewrite (filter_ext_in _ _ _ H). reflexivity. Qed.

Lemma add8 a b c d e f g h w : 0 <= w <= 8 ^ 18 ->
  0 <= a <= w -> 0 <= b <= w -> 0 <= c <= w -> 0 <= d <= w -> 0 <= e <= w -> 0 <= f <= w -> 0 <= g <= w -> 0 <= h <= w ->
  add a (add b (add c (add d (add e (add f (add g h)))))) = a + b + c + d + e + f + g + h.
Proof.
  change (8 ^ 18) with 18014398509481984. intros.
  rewrite (add_small g), (add_small f), (add_small e), (add_small d), (add_small c), (add_small b), (add_small a) by (unfold small; lia). lia.
Qed.

Lemma count_child_right w z t : count_child (count_edge w z) w z t = count_edge w z t.
Proof. destruct t; reflexivity. Qed.

Section Tree.
Variable s0 : side.
(** A count that adds up over children, on a tree that is counted by them. *)
Lemma number_kids f n x y z t : inner t -> number f (flat s0 (S n) x y z t) =
  let q i j k := number f (flat_kid s0 n x y z t (i, j, k)) in
  q false false false + q true false false + q false true false + q true true false +
  q false false true + q true false true + q false true true + q true true true.
Proof.
  intros T. rewrite flat_kids by exact T. unfold corners. cbn [flat_map]. rewrite !number_app. cbv beta zeta.
  replace (number f []) with 0 by reflexivity. lia.
Qed.

Lemma eight_le n : (S n <= 19)%nat -> 0 <= 8 ^ Z.of_nat n <= 8 ^ 18.
Proof. intros. split; [apply Z.lt_le_incl, eight_pos | apply Z.pow_le_mono_r; lia]. Qed.

Lemma number_cube f h x y z k : 0 <= number f (flat s0 h x y z (Cube k)) <= 8 ^ Z.of_nat h.
Proof.
  pose proof (eight_pos h). unfold number. destruct h; cbn [flat]; destruct (side_in s0 k); cbn [filter];
  try destruct (f _); cbn [length]; lia.
Qed.

Lemma count_edge_right k0 w : forall h t, deep h t -> forall x y z, (h <= 19)%nat -> sized k0 h t ->
  count_edge w (E h) t = number (fun a => edge a =? w) (flat s0 h x y z t) /\ number (fun a => edge a =? w) (flat s0 h x y z t) <= 8 ^ Z.of_nat h.
Proof.
  assert (forall h t x y z, sized k0 h t -> (most t (E h) <? w) || (w <? least t (E h)) = true ->
    number (fun a => edge a =? w) (flat s0 h x y z t) = 0) as ZERO.
  { intros h t x y z S H. apply number_none. intros a A. apply (flat_size k0) in A; [|exact S].
    apply Z.eqb_neq. apply orb_prop in H. rewrite !Z.ltb_lt in H. lia. }
  by_tree.
  - intros h k x y z L S. split; [|apply number_cube].
    assert (count_edge w (E h) (Cube k) = if same Empty k then 0 else if E h =? w then 1 else 0) as -> by reflexivity.
    destruct (same Empty k) eqn:Q; [destruct k; try discriminate; destruct h; reflexivity|].
    assert (exists s, flat s0 h x y z (Cube k) = [Leaf x y z (19 - Z.of_nat h) s]) as (s & ->) by (destruct h, k; try discriminate; eexists; reflexivity).
    unfold number. cbn [filter]. unfold edge. cbn [level]. rewrite E_cells. destruct (E h =? w); reflexivity.
  - intros n t T _ IH x y z L S.
    assert (forall i j k, sized k0 n (kid i j k t)) as SK by (inversion S; subst; trivial; contradiction).
    assert (forall i j k, 0 <= number (fun a => edge a =? w) (flat_kid s0 n x y z t (i, j, k)) <= 8 ^ Z.of_nat n) as B
      by (intros i j k; split; [apply number_pos | apply IH; [lia | apply SK]]).
    pose proof (B false false false) as B0. pose proof (B true false false) as B1. pose proof (B false true false) as B2. pose proof (B true true false) as B3.
    pose proof (B false false true) as B4. pose proof (B true false true) as B5. pose proof (B false true true) as B6. pose proof (B true true true) as B7.
    split.
    + destruct ((most t (E (Datatypes.S n)) <? w) || (w <? least t (E (Datatypes.S n)))) eqn:Q.
      * rewrite (ZERO (Datatypes.S n)) by assumption. destruct t as [| p q r a b c d e f g h]; [contradiction|]. cbn [count_edge]. cbn [most least] in Q. rewrite Q. reflexivity.
      * assert (forall i j k, count_edge w (E n) (kid i j k t) = number (fun a => edge a =? w) (flat_kid s0 n x y z t (i, j, k))) as C
          by (intros i j k; apply IH; [lia | apply SK]).
        rewrite (number_kids _ n) by exact T. cbv beta zeta. rewrite <- !C in *.
        destruct t as [| p q r a b c d e f g h]; [contradiction|]. cbn [count_edge]. cbn [most least] in Q. rewrite Q, half. cbn [kid] in *. cbv beta zeta.
        rewrite !count_child_right.
        apply (add8 _ _ _ _ _ _ _ _ (8 ^ Z.of_nat n)); trivial. apply eight_le. exact L.
    + rewrite number_kids, eight by exact T. cbv beta zeta. lia.
Qed.

(** Leaves of kind k. *)
Fixpoint count_kind (k : kind) (t : tree) : Z :=
  match t with
  | Cube k' => if same k k' then 1 else 0
  | Node _ _ _ a b c d e f g h =>
    count_kind k a + count_kind k b + count_kind k c + count_kind k d + count_kind k e + count_kind k f + count_kind k g + count_kind k h
  end.
Lemma count_kind_right k s : side_in s0 k = Some s -> (forall k', side_in s0 k' = Some s -> k' = k) ->
  forall h t, deep h t -> forall x y z, count_kind k t = number (fun a => is_side s (side_of a)) (flat s0 h x y z t).
Proof.
  intros K U. by_tree.
  - intros h k' x y z. cbn [count_kind].
    assert (flat s0 h x y z (Cube k') = match side_in s0 k' with None => [] | Some s => [Leaf x y z (19 - Z.of_nat h) s] end) as -> by (destruct h; reflexivity).
    destruct (same k k') eqn:Q.
    + assert (k' = k) as -> by (destruct k, k'; try discriminate; reflexivity). rewrite K. unfold number. cbn [filter side_of]. destruct s; reflexivity.
    + destruct (side_in s0 k') as [s'|] eqn:F; [|reflexivity]. unfold number. cbn [filter side_of].
      destruct (is_side s s') eqn:W; [|reflexivity]. exfalso.
      assert (s' = s) as -> by (destruct s, s'; try discriminate; reflexivity). apply U in F. subst k'. destruct k; discriminate.
  - intros n t T _ IH x y z.
    assert (forall i j l, count_kind k (kid i j l t) = number (fun a => is_side s (side_of a)) (flat_kid s0 n x y z t (i, j, l))) as C by (intros; apply IH).
    rewrite (number_kids _ n) by exact T. cbv beta zeta. rewrite <- !C. destruct t; [contradiction|]. reflexivity.
Qed.
End Tree.

Lemma count_kind_bound k : forall h t, deep h t -> 0 <= count_kind k t <= 8 ^ Z.of_nat h.
Proof.
  by_tree.
  - intros h k'. pose proof (eight_pos h). cbn [count_kind]. destruct (same k k'); lia.
  - intros n t T _ IH. rewrite eight. pose proof (IH false false false). pose proof (IH true false false). pose proof (IH false true false).
    pose proof (IH true true false). pose proof (IH false false true). pose proof (IH true false true). pose proof (IH false true true).
    pose proof (IH true true true). destruct t; [contradiction|]. cbn [count_kind kid] in *. lia.
Qed.
Definition room (a h : Z) : Prop := 0 <= a /\ a + 8 ^ h <= 8 ^ 20.
Lemma count_kinds_right : forall h t, deep h t -> forall o i x, room o (Z.of_nat h) -> room i (Z.of_nat h) -> room x (Z.of_nat h) ->
  count_kinds t (Tally o i x) = Tally (o + count_kind Outer t) (i + count_kind Inner t) (x + count_kind Cross t).
Proof.
  unfold room. change (8 ^ 20) with 1152921504606846976. by_tree.
  - intros h k o i x O I' X. pose proof (eight_pos h).
    destruct k; cbn [count_kinds count_kind same]; rewrite ?Z.add_0_r; try reflexivity; rewrite (add_small _ 1) by (unfold small; lia); reflexivity.
  - intros n t T D IH o i x O I' X. rewrite eight in *. pose proof (eight_pos n).
    assert (forall a b c, deep n (kid a b c t)) as DK by (apply deep_kid; assumption).
    pose proof (fun k a b c => count_kind_bound k n (kid a b c t) (DK a b c)) as B. clear DK D.
    destruct t as [| p q r t0 t1 t2 t3 t4 t5 t6 t7]; [contradiction|]. cbn [count_kinds count_kind].
    assert (forall k, 0 <= count_kind k t0 <= 8 ^ Z.of_nat n /\ 0 <= count_kind k t1 <= 8 ^ Z.of_nat n /\ 0 <= count_kind k t2 <= 8 ^ Z.of_nat n /\
      0 <= count_kind k t3 <= 8 ^ Z.of_nat n /\ 0 <= count_kind k t4 <= 8 ^ Z.of_nat n /\ 0 <= count_kind k t5 <= 8 ^ Z.of_nat n /\
      0 <= count_kind k t6 <= 8 ^ Z.of_nat n /\ 0 <= count_kind k t7 <= 8 ^ Z.of_nat n) as BK.
    { intros k. repeat split; first [apply (B k false false false) | apply (B k true false false) | apply (B k false true false) | apply (B k true true false)
        | apply (B k false false true) | apply (B k true false true) | apply (B k false true true) | apply (B k true true true)]. }
    clear B. pose proof (BK Outer) as BO. pose proof (BK Inner) as BI. pose proof (BK Cross) as BX. clear BK.
    pose proof (IH false false false) as H0. pose proof (IH true false false) as H1. pose proof (IH false true false) as H2. pose proof (IH true true false) as H3.
    pose proof (IH false false true) as H4. pose proof (IH true false true) as H5. pose proof (IH false true true) as H6. pose proof (IH true true true) as H7.
    cbn [kid] in *. clear IH. set (w := 8 ^ Z.of_nat n) in *. clearbody w.
    rewrite H0, H1, H2, H3, H4, H5, H6, H7 by lia. f_equal; ring.
Qed.

Lemma all_equal_right a b : all_equal a b = true -> a = b.
Proof.
  revert b. induction a as [| x a IH]; intros [| y b] H; cbn [all_equal] in H; try discriminate; [reflexivity|].
  apply andb_prop in H. destruct H as [P Q]. apply Z.eqb_eq in P. apply IH in Q. congruence.
Qed.

Lemma three_sides l : Z.of_nat (length l) = number (fun a => is_side Outside (side_of a)) l +
  (number (fun a => is_side Inside (side_of a)) l + number (fun a => is_side Crossing (side_of a)) l).
Proof.
  unfold number. induction l as [| a l IH]; [reflexivity|]. cbn [length filter]. destruct (side_of a); cbn [is_side length] in *; lia.
Qed.

Lemma counts_right k0 f parts t : sized k0 19 t -> (forall s0, Permutation (flat s0 19 0 0 0 t) (leaves parts)) ->
  check_counts f parts t = true -> counted f parts.
Proof.
  intros S P H. unfold check_counts in H. cbv beta zeta in H.
  pose proof (sized_deep k0 19 t S) as D. rewrite (count_kinds_right 19 t D 0 0 0) in H by (split; [lia | discriminate]). rewrite !Z.add_0_l in H.
  apply andb_prop in H. destruct H as [H H4]. apply andb_prop in H. destruct H as [H H3]. apply andb_prop in H. destruct H as [H1 H2].
  apply all_equal_right in H1, H2, H3. apply Z.eqb_eq in H4.
  assert (forall k s s0, side_in s0 k = Some s -> (forall k', side_in s0 k' = Some s -> k' = k) ->
    count_kind k t = number (fun a => is_side s (side_of a)) (leaves parts) /\ 0 <= count_kind k t <= 8 ^ 19) as KIND.
  { intros k s s0 K U. split; [|exact (count_kind_bound k 19 t D)].
    rewrite (count_kind_right s0 k s K U 19 t D 0 0 0). apply number_permutation, P. }
  destruct (KIND Outer Outside Crossing eq_refl) as [K1 B1]; [intros []; simpl; congruence|].
  destruct (KIND Inner Inside Crossing eq_refl) as [K2 B2]; [intros []; simpl; congruence|].
  destruct (KIND Cross Crossing Outside eq_refl) as [K3 B3]; [intros []; simpl; congruence|].
  change (8 ^ 19) with 144115188075855872 in *.
  cbn [sum3] in H4. rewrite (add_small (count_kind Inner t)), add_small in H4 by (unfold small; lia).
  split; [exact H1|]. split; [|split].
  - rewrite H4, K1, K2, K3. symmetry. apply three_sides.
  - rewrite H2. assert (forall l, (l <= 19)%nat -> count_edge (E (19 - l)) 524288 t = number (fun a => level a =? Z.of_nat l) (leaves parts)) as C.
    { intros l L. rewrite <- E_root. destruct (count_edge_right Outside k0 (E (19 - l)) 19 t D 0 0 0) as [-> _]; [lia | exact S|].
      rewrite <- (number_permutation _ _ _ (P Outside)). apply number_ext. intros a A.
      apply flat_inside in A; [|exact D]. destruct A as (_ & _ & _ & _ & A). unfold edge, cells.
      replace (E (19 - l)) with (2 ^ (19 - Z.of_nat l)) by (rewrite <- E_cells; unfold cells; f_equal; lia).
      destruct (Z.eqb_spec (level a) (Z.of_nat l)) as [-> | N]; [apply Z.eqb_refl|]. apply Z.eqb_neq. intros Q. apply N.
      apply Z.pow_inj_r in Q; lia. }
    rewrite map_map. unfold edges.
    assert (forall l, (l <= 19)%nat -> count_edge (2 ^ Z.of_nat (19 - l)) 524288 t = number (fun a => level a =? Z.of_nat l) (leaves parts)) as C'
      by (intros l L; rewrite <- (C l L); reflexivity).
    pose proof (C' 0%nat) as C0. pose proof (C' 1%nat) as C1. pose proof (C' 2%nat) as C2. pose proof (C' 3%nat) as C3. pose proof (C' 4%nat) as C4.
    pose proof (C' 5%nat) as C5. pose proof (C' 6%nat) as C6. pose proof (C' 7%nat) as C7. pose proof (C' 8%nat) as C8. pose proof (C' 9%nat) as C9.
    pose proof (C' 10%nat) as C10. pose proof (C' 11%nat) as C11. pose proof (C' 12%nat) as C12. pose proof (C' 13%nat) as C13. pose proof (C' 14%nat) as C14.
    pose proof (C' 15%nat) as C15. pose proof (C' 16%nat) as C16. pose proof (C' 17%nat) as C17. pose proof (C' 18%nat) as C18. pose proof (C' 19%nat) as C19.
    cbn [map seq]. clear - C0 C1 C2 C3 C4 C5 C6 C7 C8 C9 C10 C11 C12 C13 C14 C15 C16 C17 C18 C19.
    rewrite <- C0, <- C1, <- C2, <- C3, <- C4, <- C5, <- C6, <- C7, <- C8, <- C9, <- C10, <- C11, <- C12, <- C13, <- C14, <- C15, <- C16, <- C17, <- C18, <- C19 by lia.
    reflexivity.
  - rewrite H3. cbn [map]. rewrite <- K1, <- K2, <- K3. reflexivity.
Qed.
