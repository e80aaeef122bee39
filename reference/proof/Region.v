(** The kept region: walks over all leaves of a tree, and over two trees at once. *)
From Coq Require Import ZArith List Bool Lia.
Import ListNotations.
From Proof Require Import Statement Checker Octants Sizes Faces Flood.
Open Scope Z_scope.

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
