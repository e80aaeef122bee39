(** What the nodes of a tree keep: bounds of the edges of their leaves, and whether they have a leaf of a kind. *)
From Coq Require Import ZArith List Bool Lia.
Import ListNotations.
From Proof Require Import Statement Checker Octants.
Open Scope Z_scope.

(** Arithmetic that does not wrap. *)
Definition small (a : Z) : Prop := -4611686018427387904 <= a < 4611686018427387904.
Lemma wrap_small a : small a -> wrap a = a.
Proof. unfold wrap, small. intros. rewrite Z.mod_small; lia. Qed.
Lemma add_small a b : small (a + b) -> add a b = a + b. Proof. apply wrap_small. Qed.
Lemma sub_small a b : small (a - b) -> sub a b = a - b. Proof. apply wrap_small. Qed.
Lemma mul_small a b : small (a * b) -> mul a b = a * b. Proof. apply wrap_small. Qed.

(** Sharing changes nothing. *)
Lemma same_brood_right t u : same_brood t u = true -> t = u.
Proof.
  assert (forall a b, same a b = true -> a = b) as S by (intros [] []; trivial; discriminate).
  unfold same_brood. intros H. repeat match type of H with match ?x with _ => _ end = _ => destruct x; try discriminate end.
  repeat match goal with H : _ && _ = true |- _ => apply andb_prop in H; destruct H end.
  repeat match goal with H : same _ _ = true |- _ => apply S in H end.
  repeat match goal with H : (_ =? _) = true |- _ => apply Z.eqb_eq in H end. subst.
  match goal with H : (if ?r then ?r' else negb ?r') = true |- _ => destruct r, r'; try discriminate end; reflexivity.
Qed.
Lemma share_right t : share t = t.
Proof.
  assert (forall s m r k, share_with s t m r k = t) as S.
  { induction s as [| [z o o' i i' x x'] s IH]; intros m r k; cbn [share_with]; [reflexivity|]. destruct (z =? m); [|apply IH].
    cbv zeta. destruct (same_brood _ t) eqn:E; [|reflexivity]. apply same_brood_right in E. exact E. }
  unfold share. repeat match goal with |- match ?x with _ => _ end = _ => destruct x; trivial end; apply S.
Qed.
Lemma twig_right z b k : twig z b k = brood z b k.
Proof.
  assert (Forall (fun '(Broods z o o' i i' x x') => o = brood z false Outer /\ o' = brood z true Outer /\ i = brood z false Inner /\ i' = brood z true Inner /\
    x = brood z false Cross /\ x' = brood z true Cross) all_broods) as A by (repeat constructor).
  unfold twig. induction A as [| [z' o o' i i' x x'] s (-> & -> & -> & -> & -> & ->) _ IH]; cbn [twig_of]; [reflexivity|].
  destruct (Z.eqb_spec z' z) as [->|]; [|exact IH]. destruct k, b; reflexivity.
Qed.
Lemma join_twig k0 z k : k <> Empty -> let c := Cube k in join k0 z c c c c c c c c = brood z (same k0 k) k.
Proof.
  intros N c. unfold join, brood, max8, min8, c. destruct k; [congruence|..]; cbn [most least has]; rewrite !Z.max_id, !Z.min_id, !orb_diag; reflexivity.
Qed.
#[global] Opaque share twig.

Section Sizes.
Variable k0 : kind.

Inductive sized : nat -> tree -> Prop :=
  | sized_cube h k : sized h (Cube k)
  | sized_node n t : inner t -> 0 <= most t 0 <= 524288 -> 0 <= least t 0 <= none ->
      (forall i j k, sized n (kid i j k t)) ->
      (forall i j k, most (kid i j k t) (E n) <= most t 0 /\ least t 0 <= least (kid i j k t) (E n) /\
                     (has k0 (kid i j k t) = true -> has k0 t = true)) ->
      sized (S n) t.

Lemma sized_deep : forall h t, sized h t -> deep h t.
Proof.
  intros h t S. induction S as [h k | n t T _ _ _ IH _].
  - destruct h; exact I.
  - apply deep_kid; [exact T | exact IH].
Qed.

Lemma sized_most h t : (h <= 19)%nat -> sized h t -> 0 <= most t (E h) <= 524288 /\ 0 <= least t (E h) <= none.
Proof.
  intros H S. pose proof (E_pos h). pose proof (E_le h H). unfold none. destruct S as [h k | n t T M L _ _].
  - destruct k; simpl; unfold none; lia.
  - destruct t; [destruct T|]. simpl in *. unfold none in L. lia.
Qed.

Lemma max8_le a b c d e f g h x : a <= x -> b <= x -> c <= x -> d <= x -> e <= x -> f <= x -> g <= x -> h <= x -> max8 a b c d e f g h <= x.
Proof. unfold max8. intros. repeat apply Z.max_lub; assumption. Qed.
Lemma min8_ge a b c d e f g h x : x <= a -> x <= b -> x <= c -> x <= d -> x <= e -> x <= f -> x <= g -> x <= h -> x <= min8 a b c d e f g h.
Proof. unfold min8. intros. repeat apply Z.min_glb; assumption. Qed.
Lemma min8_max8 a b c d e f g h x : x = a \/ x = b \/ x = c \/ x = d \/ x = e \/ x = f \/ x = g \/ x = h ->
  min8 a b c d e f g h <= x <= max8 a b c d e f g h.
Proof.
  unfold min8, max8. pose proof (Z.le_refl x). intros [->|[->|[->|[->|[->|[->|[->| ->]]]]]]];
  rewrite !Z.min_le_iff, !Z.max_le_iff; tauto.
Qed.

Lemma sized_join n a b c d e f g h : (n <= 18)%nat -> let t := join k0 (E n) a b c d e f g h in
  (forall i j k, sized n (kid i j k t)) -> sized (S n) t.
Proof.
  intros N t H.
  assert (forall i j k, least t 0 <= least (kid i j k t) (E n) /\ most (kid i j k t) (E n) <= most t 0) as B.
  { intros i j k. unfold t, join. cbn [most least].
    destruct i, j, k; cbn [kid]; (split; [|]); (eapply Z.le_trans; [|]; [apply min8_max8 | apply Z.le_refl]) || apply min8_max8; tauto. }
  assert (forall i j k, 0 <= most (kid i j k t) (E n) <= 524288 /\ 0 <= least (kid i j k t) (E n) <= none) as C
    by (intros i j k; apply sized_most; [lia | apply H]).
  constructor; [exact I | | | exact H |].
  - pose proof (B false false false). pose proof (C false false false). split; [lia|].
    unfold t at 1, join. cbn [most]. apply max8_le;
    [apply (C false false false) | apply (C true false false) | apply (C false true false) | apply (C true true false) |
     apply (C false false true) | apply (C true false true) | apply (C false true true) | apply (C true true true)].
  - pose proof (B false false false). pose proof (C false false false). split; [|lia].
    unfold t at 1, join. cbn [least]. apply min8_ge;
    [apply (C false false false) | apply (C true false false) | apply (C false true false) | apply (C true true false) |
     apply (C false false true) | apply (C true false true) | apply (C false true true) | apply (C true true true)].
  - intros i j k. split; [apply B | split; [apply B|]]. unfold t, join. cbn [has].
    destruct i, j, k; cbn [kid]; intros ->; rewrite ?orb_true_r; reflexivity.
Qed.

Lemma flat_size s0 : forall h t, sized h t -> forall x y z o, In o (flat s0 h x y z t) -> least t (E h) <= edge o <= most t (E h).
Proof.
  intros h t S. induction S as [h k | n t T _ _ _ IH B]; intros x y z o H.
  - apply flat_cube in H. destruct H as (s & K & ->). unfold edge. cbn [level]. rewrite E_cells.
    destruct k; cbn [most least]; [discriminate | lia ..].
  - apply in_flat in H; [|exact T]. destruct H as (i & j & k & H). apply IH in H. specialize (B i j k).
    destruct t; [destruct T|]. simpl in *. lia.
Qed.

(** A tree without the kind has no leaf of it. *)
Lemma flat_has s0 s : side_in s0 k0 = Some s -> (forall k, side_in s0 k = Some s -> k = k0) ->
  forall h t, sized h t -> has k0 t = false -> forall x y z o, In o (flat s0 h x y z t) -> side_of o <> s.
Proof.
  intros K U h t S. induction S as [h k | n t T _ _ _ IH B]; intros F x y z o H.
  - apply flat_cube in H. destruct H as (s' & Q & ->). cbn [side_of].
    intros ->. apply U in Q. subst k. destruct k0; discriminate.
  - apply in_flat in H; [|exact T]. destruct H as (i & j & k & H). apply IH in H; [exact H|].
    destruct (B i j k) as (_ & _ & C). destruct (has k0 (kid i j k t)); [rewrite C in F; congruence | reflexivity].
Qed.
End Sizes.
