(** What walks over pairs of octants, and over neighbours, have accepted holds for all pairs of leaves, and for all that share part of a
    face. *)
From Coq Require Import ZArith List Bool Lia.
Import ListNotations.
From Proof Require Import Statement Checker Octants.
Open Scope Z_scope.

(** * Rules about pairs of leaves *)

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

(** * Leaves that share part of a face *)

(** The unit step along an axis. *)
Definition dx a := match a with X => 1 | _ => 0 end.
Definition dy a := match a with Y => 1 | _ => 0 end.
Definition dz a := match a with Z_ => 1 | _ => 0 end.

Definition in_cube (h : nat) (x y z u v w : Z) : Prop := x <= u < x + E h /\ y <= v < y + E h /\ z <= w < z + E h.
Lemma in_kid n x y z u v w i j k : in_cube (S n) x y z u v w ->
  (if i : bool then x + E n <= u else u < x + E n) -> (if j : bool then y + E n <= v else v < y + E n) ->
  (if k : bool then z + E n <= w else w < z + E n) -> in_cube n (x + off i n) (y + off j n) (z + off k n) u v w.
Proof. unfold in_cube, off. rewrite E_S. destruct i, j, k; lia. Qed.

Section Faces.
Variable k0 : kind.

Lemma face_kids n a t u : face k0 (S n) a t u = true ->
  (exists k k', t = Cube k /\ u = Cube k' /\ may_share k0 k k' = true) \/
  ((inner t \/ inner u) /\ forall i j, face k0 n a (kid_on a true i j t) (kid_on a false i j u) = true).
Proof.
  intros H. cbn [face] in H. destruct t as [k|], u as [k'|];
    [left; exists k, k'; auto | right | right | right]; (split; [simpl; tauto|]); split_and;
    intros i1 i2; destruct i1, i2; assumption.
Qed.

Lemma face_right : forall fuel a h t u x y z p q r, deep h t -> deep h u -> face k0 fuel a t u = true ->
  in_cube h x y z p q r -> in_cube h (x + dx a * E h) (y + dy a * E h) (z + dz a * E h) (p + dx a) (q + dy a) (r + dz a) ->
  may_share k0 (look h x y z p q r t)
    (look h (x + dx a * E h) (y + dy a * E h) (z + dz a * E h) (p + dx a) (q + dy a) (r + dz a) u) = true.
Proof.
  induction fuel as [| fuel IH]; intros a h t u x y z p q r Dt Du H P Q.
  - destruct t as [k|], u as [k'|]; try discriminate. rewrite !look_cube. exact H.
  - apply face_kids in H. destruct H as [(k & k' & -> & -> & H) | [T H]]; [rewrite !look_cube; exact H|].
    destruct h as [| n]; [exfalso; destruct T as [T|T]; [exact (deep_O t T Dt) | exact (deep_O u T Du)]|].
    destruct (look_kid n x y z p q r t) as (i & j & k & L & A & B & C). rewrite L.
    pose proof (in_kid n _ _ _ _ _ _ i j k P A B C) as P'. pose proof (E_pos n) as EP.
    unfold in_cube in P, Q. rewrite E_S in P, Q.
    destruct a; cbn [dx dy dz] in *; rewrite ?Z.mul_0_l, ?Z.add_0_r, ?Z.mul_1_l in *.
    + assert (i = true) as -> by (destruct i; trivial; lia).
      rewrite (look_at n (x + E (S n)) y z (p + 1) q r u false j k) by (rewrite ?E_S; destruct j, k; lia).
      specialize (IH X n (kid true j k t) (kid false j k u) (x + off true n) (y + off j n) (z + off k n) p q r).
      cbn [dx dy dz] in IH. rewrite ?Z.mul_0_l, ?Z.add_0_r, ?Z.mul_1_l in IH.
      replace (x + off true n + E n) with (x + E (S n) + off false n) in IH by (rewrite E_S; cbn [off]; lia).
      apply IH; [apply deep_Kid; exact Dt | apply deep_Kid; exact Du | exact (H j k) | exact P' |].
      unfold in_cube in *. rewrite E_S. cbn [off] in *. lia.
    + assert (j = true) as -> by (destruct j; trivial; lia).
      rewrite (look_at n x (y + E (S n)) z p (q + 1) r u i false k) by (rewrite ?E_S; destruct i, k; lia).
      specialize (IH Y n (kid i true k t) (kid i false k u) (x + off i n) (y + off true n) (z + off k n) p q r).
      cbn [dx dy dz] in IH. rewrite ?Z.mul_0_l, ?Z.add_0_r, ?Z.mul_1_l in IH.
      replace (y + off true n + E n) with (y + E (S n) + off false n) in IH by (rewrite E_S; cbn [off]; lia).
      apply IH; [apply deep_Kid; exact Dt | apply deep_Kid; exact Du | exact (H i k) | exact P' |].
      unfold in_cube in *. rewrite E_S. cbn [off] in *. lia.
    + assert (k = true) as -> by (destruct k; trivial; lia).
      rewrite (look_at n x y (z + E (S n)) p q (r + 1) u i j false) by (rewrite ?E_S; destruct i, j; lia).
      specialize (IH Z_ n (kid i j true t) (kid i j false u) (x + off i n) (y + off j n) (z + off true n) p q r).
      cbn [dx dy dz] in IH. rewrite ?Z.mul_0_l, ?Z.add_0_r, ?Z.mul_1_l in IH.
      replace (z + off true n + E n) with (z + E (S n) + off false n) in IH by (rewrite E_S; cbn [off]; lia).
      apply IH; [apply deep_Kid; exact Dt | apply deep_Kid; exact Du | exact (H i j) | exact P' |].
      unfold in_cube in *. rewrite E_S. cbn [off] in *. lia.
Qed.

Lemma faces_kids n t : inner t -> faces k0 (S n) t = true ->
  (forall a i j, face k0 n a (kid_on a false i j t) (kid_on a true i j t) = true) /\ forall i j k, faces k0 n (kid i j k t) = true.
Proof.
  destruct t; [contradiction|]. intros _ H. cbn [faces] in H. split_and. split.
  - intros a i j. destruct a, i, j; assumption.
  - intros i j k. destruct i, j, k; assumption.
Qed.

Lemma faces_right a : forall h t, deep h t -> forall fuel x y z p q r, faces k0 fuel t = true ->
  in_cube h x y z p q r -> in_cube h x y z (p + dx a) (q + dy a) (r + dz a) ->
  may_share k0 (look h x y z p q r t) (look h x y z (p + dx a) (q + dy a) (r + dz a) t) = true \/
  look h x y z p q r t = look h x y z (p + dx a) (q + dy a) (r + dz a) t.
Proof.
  by_tree.
  - intros h k fuel x y z p q r _ _ _. rewrite !look_cube. right. reflexivity.
  - intros n t T D IH fuel x y z p q r H P Q.
    destruct fuel as [| fuel]; [destruct t; [contradiction | discriminate]|].
    apply faces_kids in H; [|exact T]. destruct H as [HF HI].
    destruct (look_kid n x y z p q r t) as (i & j & k & L & A & B & C). rewrite L.
    destruct (look_kid n x y z (p + dx a) (q + dy a) (r + dz a) t) as (i' & j' & k' & L' & A' & B' & C'). rewrite L'.
    pose proof (in_kid n _ _ _ _ _ _ i j k P A B C) as P'. pose proof (in_kid n _ _ _ _ _ _ i' j' k' Q A' B' C') as Q'.
    pose proof (E_pos n) as EP.
    assert ((i' = i /\ j' = j /\ k' = k) \/ (i = false /\ i' = true /\ j' = j /\ k' = k /\ a = X) \/
            (j = false /\ j' = true /\ i' = i /\ k' = k /\ a = Y) \/ (k = false /\ k' = true /\ i' = i /\ j' = j /\ a = Z_)) as S.
    { clear - A B C A' B' C'. destruct a; cbn [dx dy dz] in *; destruct i, i'; try lia; destruct j, j'; try lia; destruct k, k'; try lia; tauto. }
    destruct S as [(-> & -> & ->) | [(-> & -> & -> & -> & ->) | [(-> & -> & -> & -> & ->) | (-> & -> & -> & -> & ->)]]].
    + exact (IH i j k fuel _ _ _ _ _ _ (HI i j k) P' Q').
    + pose proof (face_right fuel X n _ _ (x + off false n) (y + off j n) (z + off k n) p q r
        (deep_Kid n t _ _ _ D) (deep_Kid n t _ _ _ D) (HF X j k) P') as F.
      cbn [dx dy dz off] in *. rewrite ?Z.mul_0_l, ?Z.add_0_r, ?Z.mul_1_l in *. left. apply F. exact Q'.
    + pose proof (face_right fuel Y n _ _ (x + off i n) (y + off false n) (z + off k n) p q r
        (deep_Kid n t _ _ _ D) (deep_Kid n t _ _ _ D) (HF Y i k) P') as F.
      cbn [dx dy dz off] in *. rewrite ?Z.mul_0_l, ?Z.add_0_r, ?Z.mul_1_l in *. left. apply F. exact Q'.
    + pose proof (face_right fuel Z_ n _ _ (x + off i n) (y + off j n) (z + off false n) p q r
        (deep_Kid n t _ _ _ D) (deep_Kid n t _ _ _ D) (HF Z_ i j) P') as F.
      cbn [dx dy dz off] in *. rewrite ?Z.mul_0_l, ?Z.add_0_r, ?Z.mul_1_l in *. left. apply F. exact Q'.
Qed.
End Faces.

Lemma may_share_sym k a b : may_share k a b = may_share k b a.
Proof. destruct k, a, b; reflexivity. Qed.
Lemma may_share_equal k a b : may_share k a b = true -> a <> Empty -> b <> Empty -> a <> Cross -> b <> Cross -> a = b.
Proof. destruct k, a, b; simpl; congruence. Qed.

(** Neighbouring unit cells differ by a step along an axis, in one direction or the other. *)
Lemma neighbours u v w u' v' w' : Z.abs (u - u') + Z.abs (v - v') + Z.abs (w - w') = 1 -> exists a,
  (u' = u + dx a /\ v' = v + dy a /\ w' = w + dz a) \/ (u = u' + dx a /\ v = v' + dy a /\ w = w' + dz a).
Proof.
  intros H. assert (Z.abs (u - u') = 1 \/ Z.abs (v - v') = 1 \/ Z.abs (w - w') = 1) as [A | [A | A]] by lia.
  - exists X. cbn. lia.
  - exists Y. cbn. lia.
  - exists Z_. cbn. lia.
Qed.

Section Root.
Variable s0 : side.
Variable k0 : kind.
Variable t : tree.
Variable h : nat.
Hypothesis H19 : h = 19%nat.
Hypothesis D : deep h t.
Let all := flat s0 h 0 0 0 t.

Lemma Eh : E h = 524288. Proof. rewrite H19. exact E_root. Qed.
Lemma root_cube u v w : in_root u v w <-> in_cube h 0 0 0 u v w.
Proof. unfold in_root, in_cube. rewrite Eh. replace (cells 0) with 524288 by reflexivity. lia. Qed.
Lemma leaf_in_root o : In o all -> forall u v w, holds o u v w -> in_root u v w.
Proof. intros O u v w P. apply (flat_inside s0 h t D) in O. apply root_cube. unfold holds, in_cube in *. lia. Qed.

Lemma shared_kind a b : faces k0 20 t = true -> In a all -> In b all -> side_of a <> Crossing -> side_of b <> Crossing -> share_face a b ->
  forall k k', (forall u v w, holds a u v w -> look h 0 0 0 u v w t = k) -> (forall u v w, holds b u v w -> look h 0 0 0 u v w t = k') ->
  side_in s0 k = Some (side_of a) -> side_in s0 k' = Some (side_of b) -> k = k'.
Proof.
  intros F A B CA CB (u & v & w & u' & v' & w' & HA & HB & N) k k' KA KB SA SB.
  assert (look h 0 0 0 u v w t = look h 0 0 0 u' v' w' t \/ may_share k0 k k' = true) as M.
  { rewrite <- (KA u v w HA), <- (KB u' v' w' HB).
    pose proof (proj1 (root_cube _ _ _) (leaf_in_root a A u v w HA)) as P.
    pose proof (proj1 (root_cube _ _ _) (leaf_in_root b B u' v' w' HB)) as Q.
    destruct (neighbours _ _ _ _ _ _ N) as [ax [(-> & -> & ->) | (-> & -> & ->)]].
    - destruct (faces_right k0 ax h t D 20 0 0 0 u v w F P Q) as [M | M]; [right | left]; exact M.
    - destruct (faces_right k0 ax h t D 20 0 0 0 u' v' w' F Q P) as [M | M]; [right; rewrite may_share_sym | left; symmetry]; exact M. }
  destruct M as [M | M]; [rewrite <- (KA u v w HA), <- (KB u' v' w' HB); exact M|].
  apply (may_share_equal k0); [exact M | intros -> .. ]; cbn [side_in] in SA, SB; congruence.
Qed.

Lemma rim_kind a : rim k0 t = true -> In a all -> at_boundary a -> forall k, (forall u v w, holds a u v w -> look h 0 0 0 u v w t = k) -> k <> Cross ->
  k <> k0 \/ k = Empty.
Proof.
  unfold rim. intros H A B k K NC.
  apply andb_prop in H. destruct H as [H F6]. apply andb_prop in H. destruct H as [H F5]. apply andb_prop in H. destruct H as [H F4].
  apply andb_prop in H. destruct H as [H F3]. apply andb_prop in H. destruct H as [F1 F2].
  pose proof (flat_inside s0 h t D _ _ _ _ A) as (BX & BY & BZ & PE & _).
  assert (forall u v w, holds a u v w -> (may_share k0 Empty k = true \/ may_share k0 k Empty = true) -> k <> k0 \/ k = Empty) as END.
  { intros u v w _ [M|M]; revert M NC; destruct k, k0; simpl; try (left; discriminate); try (right; reflexivity); discriminate || congruence. }
  assert (deep h (Cube Empty)) as DE by (destruct h; exact I).
  rewrite Eh in *.
  assert (holds a (cx a) (cy a) (cz a)) as HC by (unfold holds; lia).
  set (ex := cx a + edge a - 1). set (ey := cy a + edge a - 1). set (ez := cz a + edge a - 1).
  apply (END _ _ _ HC).
  unfold at_boundary in B. assert (cells 0 = 524288) as C0 by reflexivity. rewrite C0 in B. destruct B as [B | [B | [B | [B | [B | B]]]]].
  - left. pose proof (face_right k0 20 X h (Cube Empty) t (-524288) 0 0 (-1) (cy a) (cz a) DE D F1) as F.
    cbn [dx dy dz] in F. rewrite Eh, look_cube in F.
    change (-524288 + 1 * 524288) with 0 in F. change (-1 + 1) with 0 in F. rewrite ?Z.mul_0_l, ?Z.add_0_r in F.
    rewrite <- (K 0 (cy a) (cz a)) by (unfold holds; lia). apply F; unfold in_cube; rewrite Eh; lia.
  - left. pose proof (face_right k0 20 Y h (Cube Empty) t 0 (-524288) 0 (cx a) (-1) (cz a) DE D F3) as F.
    cbn [dx dy dz] in F. rewrite Eh, look_cube in F.
    change (-524288 + 1 * 524288) with 0 in F. change (-1 + 1) with 0 in F. rewrite ?Z.mul_0_l, ?Z.add_0_r in F.
    rewrite <- (K (cx a) 0 (cz a)) by (unfold holds; lia). apply F; unfold in_cube; rewrite Eh; lia.
  - left. pose proof (face_right k0 20 Z_ h (Cube Empty) t 0 0 (-524288) (cx a) (cy a) (-1) DE D F5) as F.
    cbn [dx dy dz] in F. rewrite Eh, look_cube in F.
    change (-524288 + 1 * 524288) with 0 in F. change (-1 + 1) with 0 in F. rewrite ?Z.mul_0_l, ?Z.add_0_r in F.
    rewrite <- (K (cx a) (cy a) 0) by (unfold holds; lia). apply F; unfold in_cube; rewrite Eh; lia.
  - right. pose proof (face_right k0 20 X h t (Cube Empty) 0 0 0 ex (cy a) (cz a) D DE F2) as F.
    cbn [dx dy dz] in F. rewrite look_cube in F.
    rewrite <- (K ex (cy a) (cz a)) by (unfold holds, ex; lia). apply F; unfold in_cube, ex; rewrite Eh; lia.
  - right. pose proof (face_right k0 20 Y h t (Cube Empty) 0 0 0 (cx a) ey (cz a) D DE F4) as F.
    cbn [dx dy dz] in F. rewrite look_cube in F.
    rewrite <- (K (cx a) ey (cz a)) by (unfold holds, ey; lia). apply F; unfold in_cube, ey; rewrite Eh; lia.
  - right. pose proof (face_right k0 20 Z_ h t (Cube Empty) 0 0 0 (cx a) (cy a) ez D DE F6) as F.
    cbn [dx dy dz] in F. rewrite look_cube in F.
    rewrite <- (K (cx a) (cy a) ez) by (unfold holds, ez; lia). apply F; unfold in_cube, ez; rewrite Eh; lia.
Qed.
End Root.
