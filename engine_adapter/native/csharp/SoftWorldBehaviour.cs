// Unity component that steps a world file. SoftBodyBehaviour.cs draws the bodies.
//
// Not tested in Unity: tests compile it with Mono against stubs/UnityEngine.cs and run it.
using System;
using System.IO;
using UnityEngine;

namespace TaichiSoft
{
    /// <summary>Steps a world file in StreamingAssets, exported with `--axes unity`, while enabled.</summary>
    // Runs before other scripts, which can use World in Start and the impulses of a step in FixedUpdate.
    [DefaultExecutionOrder(-100)]
    public sealed class SoftWorldBehaviour : MonoBehaviour
    {
        /// <summary>A collider or frame of the world file that follows a transform.</summary>
        [Serializable]
        public struct Follower
        {
            /// <summary>Name of the collider or frame in the world file.</summary>
            public string name;
            /// <summary>Transform to follow.</summary>
            public Transform target;
        }

        [SerializeField, Tooltip("Folder in StreamingAssets, written by: taichi-soft export --axes unity")]
        private string folder = "game.softworld";

        [SerializeField, Tooltip("Colliders that follow game objects")]
        private Follower[] colliders = new Follower[0];

        [SerializeField, Tooltip("Frames that follow game objects")]
        private Follower[] frames = new Follower[0];

        private readonly SoftEvent[] events = new SoftEvent[64]; // the first `toldCount` events have been delivered
        private EventKinds recorded;
        private int eventCount, toldCount;
        private int[] colliderNumbers, frameNumbers;
        private float fixedStep;
        private double ahead; // time that Update has added since the last step [s]

        /// <summary>The world file. Null before Awake and after OnDestroy.</summary>
        public Scene Scene { get; private set; }

        /// <summary>The world. Null before Awake and after OnDestroy.</summary>
        public World World { get; private set; }

        /// <summary>Clock after the last Advance.</summary>
        public Clock Clock { get; private set; }

        /// <summary>A body touches a collider or another body. All events are delivered in Update.</summary>
        /// <remarks>Kinds without listeners are not recorded. Subscribe in Start, before the first step.</remarks>
        public event Action<SoftEvent> ContactBegan;

        /// <summary>A contact ended. Impulse and Duration refer to the whole contact.</summary>
        public event Action<SoftEvent> ContactEnded;

        /// <summary>A body fell asleep and costs no time.</summary>
        public event Action<SoftEvent> FellAsleep;

        /// <summary>A sleeping body woke.</summary>
        public event Action<SoftEvent> Woke;

        /// <summary>A body became invalid and was frozen in its last valid state.</summary>
        public event Action<SoftEvent> Froze;

        /// <summary>A body came into a sensor, whose number is Collider.</summary>
        public event Action<SoftEvent> Entered;

        /// <summary>A body left a sensor, or one of the two was removed.</summary>
        public event Action<SoftEvent> Left;

        private void Awake()
        {
            Scene = new Scene(Path.Combine(Application.streamingAssetsPath, folder));
            World = new World(Scene);
            colliderNumbers = NumbersOf(NameKind.Collider, colliders);
            frameNumbers = NumbersOf(NameKind.Frame, frames);
        }

        private int[] NumbersOf(NameKind kind, Follower[] followers)
        {
            var numbers = new int[followers.Length];
            for (int i = 0; i < numbers.Length; ++i) numbers[i] = Scene.Find(kind, followers[i].name);
            return numbers;
        }

        // Unity calls FixedUpdate once per step and Update once per frame. Update advances the world by the time since
        // the last step, and FixedUpdate by the rest of the step. So each FixedUpdate makes one step, and alpha is
        // correct.
        private void FixedUpdate()
        {
            if (fixedStep != Time.fixedDeltaTime)
            {
                fixedStep = Time.fixedDeltaTime;
                World.SetFixedStep(fixedStep); // also discards the time that Update has added
                ahead = 0;
            }
            Record();
            for (int i = 0; i < colliderNumbers.Length; ++i)
            {
                World.MoveCollider(colliderNumbers[i], PoseOf(colliders[i].target));
            }
            for (int i = 0; i < frameNumbers.Length; ++i)
            {
                World.MoveFrame(frameNumbers[i], PoseOf(frames[i].target));
            }
            Clock = World.Advance(fixedStep - ahead);
            ahead = 0;
        }

        private void Update()
        {
            if (fixedStep == 0) return; // no step yet
            double now = Math.Min((double)Time.time - Time.fixedTime, 0.999 * fixedStep);
            if (now > ahead)
            {
                Clock = World.Advance(now - ahead);
                ahead = now;
            }
            TellEvents();
        }

        private void Record()
        {
            EventKinds wanted = 0;
            if (ContactBegan != null) wanted |= EventKinds.ContactBegan;
            if (ContactEnded != null) wanted |= EventKinds.ContactEnded;
            if (FellAsleep != null) wanted |= EventKinds.FellAsleep;
            if (Woke != null) wanted |= EventKinds.Woke;
            if (Froze != null) wanted |= EventKinds.Froze;
            if (Entered != null) wanted |= EventKinds.Entered;
            if (Left != null) wanted |= EventKinds.Left;
            if (wanted == recorded) return;
            recorded = wanted; // set first, so that an exception below is thrown only once
            World.RecordEvents(wanted);
        }

        // If a listener throws, the remaining events are delivered in the next frame.
        private void TellEvents()
        {
            while (World != null) // a listener can destroy the world
            {
                if (toldCount == eventCount)
                {
                    toldCount = 0;
                    eventCount = 0; // even if the next line throws
                    eventCount = World.DrainEvents(events);
                    if (eventCount == 0) return;
                }
                SoftEvent next = events[toldCount++];
                Action<SoftEvent> listeners = ListenersTo(next.Kind);
                if (listeners != null) listeners(next);
            }
        }

        private Action<SoftEvent> ListenersTo(EventKinds kind)
        {
            switch (kind)
            {
                case EventKinds.ContactBegan: return ContactBegan;
                case EventKinds.ContactEnded: return ContactEnded;
                case EventKinds.FellAsleep: return FellAsleep;
                case EventKinds.Woke: return Woke;
                case EventKinds.Froze: return Froze;
                case EventKinds.Entered: return Entered;
                default: return Left;
            }
        }

        private void OnDestroy()
        {
            if (World != null) World.Dispose();
            if (Scene != null) Scene.Dispose();
            World = null;
            Scene = null;
        }

        private static Pose PoseOf(Transform target)
        {
            Vector3 p = target.position;
            Quaternion r = target.rotation;
            return new Pose(new Vector3d(p.x, p.y, p.z), new Quaterniond(r.x, r.y, r.z, r.w));
        }
    }
}
