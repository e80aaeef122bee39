(** Faces: what the walk over neighbours has accepted holds for all leaves that share part of a face. *)
From Coq Require Import ZArith List Bool Lia.
Import ListNotations.
From Proof Require Import Statement Checker Octants.
Open Scope Z_scope.

Ltac split_and := repeat match goal with H : _ && _ = true |- _ => apply andb_prop in H; destruct H end.

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
