(** Rules about pairs of leaves: what a walk over pairs of octants has accepted holds for all pairs of leaves. *)
From Coq Require Import ZArith List Bool Lia.
Import ListNotations.
From Proof Require Import Statement Checker Octants Sizes.
Open Scope Z_scope.

Ltac split_and := repeat match goal with H : _ && _ = true |- _ => apply andb_prop in H; destruct H end.

Section Walk.
Variable k0 : kind.
Variable s0 : side.
Variable skip : tree -> Z -> tree -> Z -> bool.
Variable stop : tree -> Z -> tree -> Z -> Z -> bool.
Variable P : leaf -> leaf -> Prop.
Definition skip_is_right := forall h g t u, (h <= 19)%nat -> (g <= 19)%nat -> sized k0 h t -> sized k0 g u -> skip t (E h) u (E g) = true ->
  forall x y z x' y' z' a b, In a (flat s0 h x y z t) -> In b (flat s0 g x' y' z' u) -> P a b.
Definition stop_is_right := forall h g t u d, (h <= 19)%nat -> (g <= 19)%nat -> sized k0 h t -> sized k0 g u -> Z.abs d <= 4194304 ->
  stop t (E h) u (E g) d = true -> forall x y z x' y' z' a b,
  In a (flat s0 h x y z t) -> In b (flat s0 g x' y' z' u) -> d <= distance a b -> P a b.
Hypothesis skip_right : skip_is_right.
Hypothesis stop_right : stop_is_right.

Lemma apart_small p q d : 0 <= p -> 0 <= q -> Z.abs d + p + q <= 2097152 ->
  apart p q d = Z.max (d - p) (- d - q) /\ Z.abs (apart p q d) <= 4194304.
Proof.
  intros A B D. unfold apart. rewrite (sub_small d p), (sub_small 0 d), (sub_small (0 - d) q) by (unfold small; lia).
  split; [f_equal; lia | lia].
Qed.

Lemma apart_gap p q d x e y f : 0 <= p -> 0 <= q -> Z.abs d + p + q <= 2097152 -> forall x0, x0 <= x -> x + e <= x0 + p ->
  x0 + d <= y -> y + f <= x0 + d + q -> apart p q d <= gap x e y f.
Proof. intros A B D x0 U V W X. destruct (apart_small p q d A B D) as [-> _]. unfold gap. lia. Qed.
Lemma max_small a b c : Z.abs a <= 4194304 -> Z.abs b <= 4194304 -> Z.abs c <= 4194304 -> Z.abs (Z.max a (Z.max b c)) <= 4194304.
Proof. intros. destruct (Z.max_spec b c) as [[_ ->]|[_ ->]]; apply Z.max_case; assumption. Qed.

Lemma stopped h g t u x y z x' y' z' a b : (h <= 19)%nat -> (g <= 19)%nat -> sized k0 h t -> sized k0 g u ->
  Z.abs (x' - x) + E h + E g <= 2097152 -> Z.abs (y' - y) + E h + E g <= 2097152 -> Z.abs (z' - z) + E h + E g <= 2097152 ->
  stop t (E h) u (E g) (Z.max (apart (E h) (E g) (x' - x)) (Z.max (apart (E h) (E g) (y' - y)) (apart (E h) (E g) (z' - z)))) = true ->
  In a (flat s0 h x y z t) -> In b (flat s0 g x' y' z' u) -> P a b.
Proof.
  intros Lh Lg St Su X Y Z' T A B. pose proof (E_pos h) as PH. pose proof (E_pos g) as PG.
  apply Z.lt_le_incl in PH. apply Z.lt_le_incl in PG.
  eapply stop_right; [exact Lh | exact Lg | exact St | exact Su | | exact T | exact A | exact B |].
  - apply max_small; apply apart_small; assumption.
  - apply flat_inside in A; [|apply (sized_deep k0); exact St]. apply flat_inside in B; [|apply (sized_deep k0); exact Su].
    destruct A as ([? ?] & [? ?] & [? ?] & _). destruct B as ([? ?] & [? ?] & [? ?] & _).
    unfold distance. apply Z.max_le_compat; [apply apart_gap with x | apply Z.max_le_compat; [apply apart_gap with y | apply apart_gap with z]];
      trivial; lia.
Qed.

(** A node is split into its children. *)
Definition pass n t u p q x y z := skip t p u q || walk skip stop n t u p q x y z.
Definition split_left n t u p q x y z := forall i j k,
  pass n (kid i j k t) u p q (if i then sub x p else x) (if j then sub y p else y) (if k then sub z p else z) = true.
Definition split_right n t u p q x y z := forall i j k,
  pass n t (kid i j k u) p q (if i then add x q else x) (if j then add y q else y) (if k then add z q else z) = true.
Lemma walk_step n t u p q x y z : walk skip stop (S n) t u p q x y z = true ->
  stop t p u q (Z.max (apart p q x) (Z.max (apart p q y) (apart p q z))) = true \/
  (inner t /\ split_left n t u (Z.shiftr p 1) q x y z) \/ (inner u /\ split_right n t u p (Z.shiftr q 1) x y z).
Proof.
  intros H. cbn [walk] in H. destruct (stop _ _ _ _ _); [left; reflexivity|]. right.
  destruct t as [|? ? ? a b c d e f g h]; (destruct u as [|? ? ? a' b' c' d' e' f' g' h']; [try discriminate|]);
    [right | left | destruct (q <? p); [left | right]]; (split; [exact I|]); cbv zeta in H; split_and;
    intros i1 i2 i3; destruct i1, i2, i3; assumption.
Qed.

Lemma walk_right : forall fuel h g t u x y z x' y' z', (h <= 19)%nat -> (g <= 19)%nat -> sized k0 h t -> sized k0 g u ->
  Z.abs (x' - x) + E h + E g <= 2097152 -> Z.abs (y' - y) + E h + E g <= 2097152 -> Z.abs (z' - z) + E h + E g <= 2097152 ->
  pass fuel t u (E h) (E g) (x' - x) (y' - y) (z' - z) = true -> forall a b,
  In a (flat s0 h x y z t) -> In b (flat s0 g x' y' z' u) -> P a b.
Proof.
  induction fuel as [| fuel IH]; intros h g t u x y z x' y' z' Lh Lg St Su X Y Z' H a b A B;
    (apply orb_prop in H; destruct H as [H|H]; [exact (skip_right h g t u Lh Lg St Su H _ _ _ _ _ _ a b A B)|]).
  - cbn [walk] in H. destruct (stop _ _ _ _ _) eqn:T; [|discriminate]. exact (stopped _ _ _ _ _ _ _ _ _ _ _ _ Lh Lg St Su X Y Z' T A B).
  - pose proof (E_pos h). pose proof (E_pos g). apply walk_step in H. destruct H as [T | [[I S] | [I S]]].
    + exact (stopped _ _ _ _ _ _ _ _ _ _ _ _ Lh Lg St Su X Y Z' T A B).
    + destruct St as [|n t T _ _ K _]; [destruct I|]. apply in_flat in A; [|exact T]. destruct A as (i & j & k & A).
      specialize (S i j k). rewrite half in S. rewrite E_S in *. pose proof (E_pos n).
      apply (IH n g (kid i j k t) u (x + off i n) (y + off j n) (z + off k n) x' y' z'); try lia; auto; unfold off.
      1-3: destruct i, j, k; lia.
      rewrite !(sub_small _ (E n)) in S by (unfold small; lia).
      replace (x' - (x + (if i then E n else 0))) with (if i then x' - x - E n else x' - x) by (destruct i; lia).
      replace (y' - (y + (if j then E n else 0))) with (if j then y' - y - E n else y' - y) by (destruct j; lia).
      replace (z' - (z + (if k then E n else 0))) with (if k then z' - z - E n else z' - z) by (destruct k; lia). exact S.
    + destruct Su as [|n u T _ _ K _]; [destruct I|]. apply in_flat in B; [|exact T]. destruct B as (i & j & k & B).
      specialize (S i j k). rewrite half in S. rewrite E_S in *. pose proof (E_pos n).
      apply (IH h n t (kid i j k u) x y z (x' + off i n) (y' + off j n) (z' + off k n)); try lia; auto; unfold off.
      1-3: destruct i, j, k; lia.
      rewrite !(add_small _ (E n)) in S by (unfold small; lia).
      replace (x' + (if i then E n else 0) - x) with (if i then x' - x + E n else x' - x) by (destruct i; lia).
      replace (y' + (if j then E n else 0) - y) with (if j then y' - y + E n else y' - y) by (destruct j; lia).
      replace (z' + (if k then E n else 0) - z) with (if k then z' - z + E n else z' - z) by (destruct k; lia). exact S.
Qed.
End Walk.

(** Pairs of leaves of two trees at the root. *)
Lemma walk_all s0 skip stop (P : leaf -> leaf -> Prop) : skip_is_right Cross s0 skip P -> stop_is_right Cross s0 stop P ->
  forall t u, sized Cross 19 t -> sized Cross 19 u -> skip t 524288 u 524288 || walk skip stop 40 t u 524288 524288 0 0 0 = true ->
  forall a b, In a (flat s0 19 0 0 0 t) -> In b (flat s0 19 0 0 0 u) -> P a b.
Proof.
  intros K R t u St Su H a b A B. apply (walk_right Cross s0 skip stop P K R 40 19 19 t u 0 0 0 0 0 0); try trivial; rewrite ?E_root; try lia.
Qed.

Section Rules.
Variable s0 : side.
Variable t : tree.
Hypothesis St : sized Cross 19 t.
Let all := flat s0 19 0 0 0 t.

Lemma level_edge a : In a all -> 0 <= level a <= 19 /\ edge a = 2 ^ (19 - level a).
Proof.
  intros A. apply flat_inside in A; [|apply (sized_deep Cross); exact St]. split; [lia | reflexivity].
Qed.
Lemma finer a b : In a all -> In b all -> level b + 2 <= level a -> 4 * edge a <= edge b.
Proof.
  intros A B L. destruct (level_edge a A) as [P ->]. destruct (level_edge b B) as [Q ->].
  replace (19 - level b) with (2 + (level a - level b - 2) + (19 - level a)) by lia.
  rewrite !Z.pow_add_r by lia. change (2 ^ 2) with 4.
  assert (0 < 2 ^ (level a - level b - 2)) by (apply Z.pow_pos_nonneg; lia).
  assert (0 < 2 ^ (19 - level a)) by (apply Z.pow_pos_nonneg; lia). nia.
Qed.

(** Balance and layers. *)
Variable n below : Z.
Hypothesis Hn : 1 <= n <= 4096.
Hypothesis Hb : 0 <= below <= 20.
Let wide := Z.shiftr 2097152 below.
Definition apart_enough a b := 4 * edge b <= edge a -> (wide <= edge a -> n * edge a <= 2 * distance a b) /\ 0 < distance a b.

Lemma graded_stop_right : stop_is_right Cross s0 (graded_stop n wide) apart_enough.
Proof.
  intros h g t' u d Lh Lg S U D H x y z x' y' z' a b A B DD. unfold graded_stop in H. cbv zeta in H.
  pose proof (proj2 (proj2 (proj2 (flat_inside s0 h t' (sized_deep Cross _ _ S) _ _ _ _ A)))) as [PA _].
  apply (flat_size Cross) in A; [|exact S]. apply (flat_size Cross) in B; [|exact U].
  destruct (sized_most Cross h t' Lh S) as [M _]. destruct (sized_most Cross g u Lg U) as [_ L]. unfold none in L.
  rewrite (mul_small 4), (mul_small 2) in H by (unfold small; lia).
  rewrite (mul_small n) in H by (unfold small; nia). intros F.
  destruct (Z.ltb_spec (most t' (E h)) (4 * least u (E g))) as [G|_]; [lia|].
  destruct (Z.leb_spec wide (most t' (E h))).
  - apply Z.leb_le in H. assert (n * edge a <= n * most t' (E h)) by nia. assert (0 < n * edge a) by nia. split; [intros _ | ]; lia.
  - apply Z.ltb_lt in H. split; intros; lia.
Qed.

Hypothesis all_apart : forall a b, In a all -> In b all -> apart_enough a b.

Lemma distance_sym a b : distance a b = distance b a.
Proof.
  assert (forall x e y f, gap x e y f = gap y f x e) as G by (intros; unfold gap; f_equal; apply Z.max_comm).
  unfold distance. rewrite (G (cx a)), (G (cy a)), (G (cz a)). reflexivity.
Qed.

Lemma all_balanced a b : In a all -> In b all -> touch a b -> Z.abs (level a - level b) <= 1.
Proof.
  assert (forall a b, In a all -> In b all -> touch a b -> level a <= level b + 1) as ONE.
  { clear a b. intros a b A B T. destruct (Z_le_dec (level a) (level b + 1)) as [|G]; [assumption|exfalso].
    assert (4 * edge a <= edge b) as F by (apply finer; trivial; lia).
    pose proof (all_apart b a B A F) as [_ D]. rewrite distance_sym, T in D. lia. }
  intros A B T. pose proof (ONE a b A B T).
  assert (touch b a) as T' by (unfold touch in *; rewrite distance_sym; exact T). pose proof (ONE b a B A T'). lia.
Qed.

Lemma all_layers l a b : In a all -> In b all -> l < below -> level a >= l + 1 -> level b <= l - 1 -> distance a b >= n * cells l.
Proof.
  intros A B L LA LB. assert (4 * edge a <= edge b) as F by (apply finer; trivial; lia).
  pose proof (all_apart b a B A F) as [D _]. rewrite distance_sym in D.
  destruct (level_edge a A) as [PA _]. destruct (level_edge b B) as [PB EB].
  assert (wide <= edge b) as W.
  { unfold wide. rewrite Z.shiftr_div_pow2 by lia. change 2097152 with (2 ^ 21). rewrite <- Z.pow_sub_r by lia.
    rewrite EB. apply Z.pow_le_mono_r; lia. }
  specialize (D W).
  assert (2 * cells l <= edge b).
  { rewrite EB. unfold cells. rewrite <- Z.pow_succ_r by lia. apply Z.pow_le_mono_r; lia. }
  nia.
Qed.
End Rules.

